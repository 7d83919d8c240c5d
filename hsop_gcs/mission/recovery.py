"""From a journal back to the mission: its inputs folded again, also where some of them are missing."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hsop_gcs.journal import Entry, Journal
from hsop_gcs.mission.core import MissionState, apply
from hsop_gcs.mission.inputs import EntriesGivenUp, Input
from hsop_gcs.mission.records import RAW, from_record
from hsop_gcs.mission.snapshots import MissionSaved

log = logging.getLogger(__name__)


class Fold:
    """The mission after each input of a journal."""

    def __init__(self) -> None:
        self.state = MissionState()
        self.begun = False
        self.exact = True
        """Whether the state is the recorded mission's own; after inputs that were given up it is near to it."""
        self.given_up = 0
        """Inputs that the journal does not have."""
        self.skipped = 0
        """Inputs that had no meaning without those that were given up, such as of a threat that is not known."""

    def take(self, given: Input) -> None:
        """Go on by one input. Raises what ``apply`` does, as long as no input is missing."""
        self.begun = True
        if isinstance(given, MissionSaved):
            self.state, self.exact = given.state, True
            return
        if isinstance(given, EntriesGivenUp):
            self.exact = False
            self.given_up += sum(given.kinds.values())
        try:
            self.state = apply(self.state, given)
        except (ValueError, LookupError, AssertionError):
            if self.exact:
                raise
            self.skipped += 1


@contextmanager
def resumed(path: Path, **settings: Any) -> Iterator[tuple[Journal, MissionState]]:
    """Open a mission's journal, or begin one; yields it with the mission as it left it. settings: of ``Journal``.

    Raises what ``Journal`` does, and BadInput for a journal of something else.
    """
    fold = Fold()

    def take(entry: Entry) -> None:
        fold.take(from_record(entry.kind, entry.data, entry.time_s))

    with Journal(path, take, raw=[kind.__name__ for kind in RAW], **settings) as journal:
        if not fold.exact:
            log.warning("journal %s: %d entries were given up; the mission goes on without them", path, fold.given_up)
        yield journal, fold.state
