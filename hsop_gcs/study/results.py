"""The results file: the study on its first line, then one trial per line, as they are finished.

A study that was interrupted is taken up where the file ends; a line that was being written then is left out.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hsop_gcs.errors import BadInput, Unavailable
from hsop_gcs.study.trial import Record, Study, Trial


class Results:
    """The trials that are finished, on disk and in memory; ``path`` None keeps them in memory alone."""

    def __init__(self, study: Study, path: Path | None) -> None:
        self.study = study
        self.path = path
        self._records: dict[Trial, Record] = {}

    @property
    def records(self) -> list[Record]:
        """Return what is finished, in the order of the study's trials however they came in."""
        return [self._records[trial] for trial in self.study.trials() if trial in self._records]

    @property
    def missing(self) -> list[Trial]:
        return [trial for trial in self.study.trials() if trial not in self._records]

    def begin(self, *, resume: bool) -> None:
        """Write the first line, or read what an interrupted run has left. Raises BadInput if that was another study."""
        if self.path is None:
            return
        header = _line({"study": self.study.as_json()})
        kept: list[str] = []
        if self.path.exists():
            if not resume:
                raise BadInput("--resume", f"{self.path} holds results; resume them or name another file")
            kept = self._read(header)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(header + "".join(kept), encoding="utf-8")
        except OSError as error:
            raise Unavailable(f"{self.path} cannot be written: {error.strerror or error}") from None

    @contextmanager
    def writing(self) -> Iterator["Results"]:
        """Keep the file open while trials come in."""
        if self.path is None:
            self._file = None
            yield self
            return
        with self.path.open("a", encoding="utf-8") as self._file:
            yield self

    def add(self, record: Record) -> None:
        """Keep a finished trial; it is on disk when this returns."""
        self._records[_trial(record)] = record
        if self._file is not None:
            self._file.write(_line(record))
            self._file.flush()

    def _read(self, header: str) -> list[str]:
        assert self.path is not None
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        if not lines or lines[0] != header:
            raise BadInput("--resume", f"{self.path} holds the results of another study, or of other assumptions")
        kept = []
        wanted = set(self.study.trials())
        for line in lines[1:]:
            try:
                record = json.loads(line)
            except ValueError:
                continue
            if line.endswith("\n") and _trial(record) in wanted:
                self._records[_trial(record)] = record
                kept.append(line)
        return kept


def _trial(record: Record) -> Trial:
    return Trial(threats=record["threats"], index=record["index"])


def _line(value: Any) -> str:
    return json.dumps(value) + "\n"
