"""What a mission is written down in never ends it."""

from pathlib import Path

from hsop_gcs.journal import GIVEN_UP, SNAPSHOT, Journal, read
from hsop_gcs.link.events import StatusTextReceived
from hsop_gcs.mission.core import MissionState
from hsop_gcs.mission.inputs import HostsHeld, HostSpoke
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.storage import Storage


def test_an_input_that_cannot_be_written_down_leaves_a_gap_that_is_told_and_made_up_for(tmp_path: Path) -> None:
    path = tmp_path / "j"
    unwritable = StatusTextReceived(system=1, severity=6, text="\ud800")
    with Journal(path) as journal:
        storage = Storage(journal, None, None)
        storage.record(HostsHeld(time_s=1.0, hosts=("h1",)))
        storage.record(HostSpoke(time_s=2.0, host="h1", event=unwritable))
        assert journal.flush(10.0)
        assert journal.status.given_up == {"HostSpoke": 1}
        list(storage.tend(MissionState(held=True), 3.0))
        storage.record(HostsHeld(time_s=4.0, hosts=("h2",)))
    assert [entry.kind for entry in read(path)] == ["HostsHeld", GIVEN_UP, SNAPSHOT, "HostsHeld"]
    with resumed(path) as (_, recovered):
        assert recovered.held
