"""What sources say of our own aircraft, in whole missions; and what the journal holds of where those were."""

import asyncio
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest

from hsop_gcs.api.views import hosts_out
from hsop_gcs.journal import Journal
from hsop_gcs.link.events import OrderFailed, OrderSuperseded
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.inputs import HostStopped, ReportsArrived, Rules
from hsop_gcs.mission.own_paths import OwnPaths
from hsop_gcs.mission.planning import PlanningRules
from hsop_gcs.mission.records import from_record, to_record
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.problem import Point
from hsop_gcs.reports import Report
from hsop_gcs.tracks import TrackRules
from hsop_gcs.tracks.own import OwnAircraft, position_at
from tests.mission.headless import EPOCH_S, Flight, Moment, fly
from tests.mission.test_safety import FAR, Planner

RULES = Rules(autonomy=Autonomy.AUTO, planning=PlanningRules(horizon_s=60.0))


class Receiver:
    """Hears of hosts late, and reports them each half a second."""

    def __init__(self, tell: Callable[[str, float, Point], Report], late_s: float) -> None:
        self._tell, self._late_s = tell, late_s
        self._past: list[tuple[float, dict[str, Point]]] = []
        self.threats: set[str] = set()
        self.farthest_m = 0.0

    def __call__(self, moment: Moment) -> None:
        mission = moment.mission
        now_s = asyncio.get_running_loop().time()
        self._past.append((now_s, mission.sky.hosts_m()))
        then = [(at_s, places) for at_s, places in self._past if at_s <= now_s - self._late_s]
        if then:
            at_s, places = then[-1]
            mission.submit([self._tell(host, at_s, place) for host, place in places.items()])
        self.threats |= set(mission.state.picture.tracks)
        first = self._past[0][1]
        moved_m = [math.dist(first[host], place) for host, place in self._past[-1][1].items() if host in first]
        self.farthest_m = max(self.farthest_m, *moved_m, 0.0)


def remote_id(host: str, at_s: float, place: Point) -> Report:
    return Report(source="rid", threat_id=f"OWN {host}", time_s=EPOCH_S + at_s, position_m=place, sigma_m=3.0)


def stamped_on_arrival(host: str, at_s: float, place: Point) -> Report:
    del host
    return Report(source="radar-2", threat_id=None, time_s=EPOCH_S + at_s + 2.0, position_m=place, sigma_m=4.0)


def far_off(host: str, at_s: float, place: Point) -> Report:
    """With its own idea of the height, and an error of position that no radius covers."""
    east, north, up = place
    return Report(
        source="adsb", threat_id=f" own  {host}", time_s=EPOCH_S + at_s, position_m=(east + 40.0, north, up + 60.0)
    )


def flown(watch: Receiver, rules: Rules, journal: Journal | None = None) -> Mission:
    flight = Flight(truth=FAR, hosts=2, duration_s=17.0, rules=rules, radar_sigma_m=0.5, camera_period_s=0.5)
    return fly(flight, watch, Planner(), journal)


@pytest.mark.parametrize(
    ("tell", "late_s", "ids"),
    [
        (remote_id, 1.2, {}),
        (stamped_on_arrival, 2.0, {}),
        (far_off, 1.0, {"ownh1": "h1", "ownh2": "h2"}),
    ],
    ids=["Remote ID", "radar, stamped on arrival", "ADS-B with known ids"],
)
def test_hosts_on_their_way_are_no_threats_and_their_orders_stand(
    tell: Callable[[str, float, Point], Report], late_s: float, ids: dict[str, str], tmp_path: Path
) -> None:
    receiver = Receiver(tell, late_s)
    rules = Rules(autonomy=RULES.autonomy, planning=RULES.planning, remote_ids=ids)
    with Journal(tmp_path / "journal") as journal:
        mission = flown(receiver, rules, journal)
    assert receiver.threats == {"t1"}
    assert receiver.farthest_m > 40.0, "they flew meanwhile"
    ended = [
        each.event for each in mission.events if isinstance(each.event, OrderSuperseded | OrderFailed | HostStopped)
    ]
    assert ended == []
    assert all(each.reported > 10 for each in hosts_out(mission))
    assert mission.refusals.problems(mission.clock()) == []
    with resumed(tmp_path / "journal") as (_, recovered):
        assert recovered == mission.state


PLACES: list[Point] = [(8.0 * min(max(0.1 * step - 3.0, 0.0), 5.0), 0.0, 30.0) for step in range(120)]
"""A host that waits for three seconds, flies for five and waits again, ten times a second."""


def told() -> OwnPaths:
    paths = OwnPaths(["h1", "h2", "h3"])
    for step, place in enumerate(PLACES):
        paths.note("h1", EPOCH_S + 0.1001 * step, place)
        paths.note("h2", EPOCH_S + 0.1001 * step, (0.0, 300.0, 30.0))
    return paths


def test_a_way_says_where_a_host_was_with_few_numbers() -> None:
    own = told().all_since(EPOCH_S, EPOCH_S + 12.0)
    assert len(own.paths["h1"]) < 9
    for step, place in enumerate(PLACES):
        assert math.dist(position_at(own.paths["h1"], EPOCH_S + 0.1001 * step), place) < 0.3
    assert own.paths["h2"] == ((round(EPOCH_S + 0.1001 * 119, 3), (0.0, 300.0, 30.0)),)


def test_only_hosts_that_a_report_may_be_of_go_into_the_journal() -> None:
    paths, now_s = told(), EPOCH_S + 12.0

    def beside(east: float, north: float, late_s: float) -> OwnAircraft:
        seen = Report(source="radar", threat_id=None, time_s=now_s - late_s, position_m=(east, north, 30.0))
        return paths.beside([seen], now_s, TrackRules())

    assert beside(20.0, 150.0, 0.1) == OwnAircraft(unheard=("h3",))
    assert set(beside(45.0, 0.0, 0.1).paths) == {"h1"}
    assert set(beside(0.0, 293.0, 0.1).paths) == {"h2"}
    assert position_at(beside(20.0, 0.0, 7.0).paths["h1"], now_s - 7.0)[0] == pytest.approx(16.0, abs=1.0)
    assert paths.beside([], now_s + 5.0, TrackRules()).unheard == ("h1", "h2", "h3")


@pytest.mark.parametrize(
    ("position_m", "most"), [((45.0, 0.0, 30.0), 260), ((5.0, 290.0, 30.0), 80), ((0.0, 150.0, 30.0), 40)]
)
def test_a_report_beside_hosts_costs_the_journal_little_and_one_elsewhere_nothing(position_m: Point, most: int) -> None:
    """Of a host that has flown, of one that hovers, of none."""
    seen = Report(source="radar", threat_id="t1", time_s=EPOCH_S + 11.9, position_m=position_m, sigma_m=3.0)
    own = told().beside([seen], EPOCH_S + 12.0, TrackRules())
    given = ReportsArrived(time_s=EPOCH_S + 12.0, measurements=(seen,), own=own)
    kind, data = to_record(given)
    assert from_record(kind, json.loads(json.dumps(data)), given.time_s) == given
    assert len(json.dumps(data["own"], separators=(",", ":"))) < most
