"""A fence that is uploaded is kept, told again and obeyed; what is no fence changes nothing."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from hsop_gcs.link.enums import MavCmd, MavMissionResult, MavMissionType, MavResult
from hsop_gcs.link.messages import (
    Message,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionItemInt,
    MissionRequestInt,
    MissionRequestList,
    ParamSet,
)
from tests.simulator.station import CONFIG, STRANGER, Station, ardupilot, px4

INSIDE, OUTSIDE = MavCmd.NAV_FENCE_POLYGON_VERTEX_INCLUSION, MavCmd.NAV_FENCE_POLYGON_VERTEX_EXCLUSION
SQUARE = [(-50.0, -50.0), (50.0, -50.0), (50.0, 50.0), (-50.0, 50.0)]
FENCE = MavMissionType.FENCE
STACKS = [
    pytest.param(px4, MavResult.ACCEPTED, id="px4"),  # accepts, tells and does not fly
    pytest.param(ardupilot, MavResult.FAILED, id="ardupilot"),
]
Stack = Callable[..., Station]


def flying(stack: Stack) -> Station:
    station = stack(replace(CONFIG, airborne_m=20.0))
    station.wait(1.0)
    station.send(ParamSet(target_system=1, target_component=1, param_id="FENCE_ENABLE", param_value=1.0, param_type=2))
    return station


def items(station: Station, kind: int, places_m: Sequence[tuple[float, float]], size: float) -> list[MissionItemInt]:
    places = [station.vehicle.local.to_geodetic(np.array([east, north, 0.0])) for east, north in places_m]
    return [
        MissionItemInt(command=kind, param1=size, x=round(each.lat_deg * 1e7), y=round(each.lon_deg * 1e7))
        for each in places
    ]


def polygon(station: Station, kind: int = INSIDE, *, east_m: float = 0.0) -> list[MissionItemInt]:
    return items(station, kind, [(east + east_m, north) for east, north in SQUARE], 4)


def upload(station: Station, fence: Sequence[MissionItemInt]) -> int:
    """Answer every request, as a ground station does; return the result of the acknowledgement."""
    answer = one(station, MissionCount(count=len(fence), mission_type=FENCE))
    while isinstance(answer, MissionRequestInt):
        assert (answer.mission_type, answer.target_system) == (FENCE, 255)
        answer = one(station, replace(fence[answer.seq], seq=answer.seq, mission_type=FENCE))
    assert isinstance(answer, MissionAck)
    return answer.type


def one(station: Station, message: Message) -> Message:
    (answer,) = [each for each in station.send(message) if type(each).__name__.startswith("Mission")]
    return answer


def download(station: Station) -> list[MissionItemInt]:
    count = one(station, MissionRequestList(mission_type=FENCE))
    assert isinstance(count, MissionCount)
    found = [one(station, MissionRequestInt(seq=seq, mission_type=FENCE)) for seq in range(count.count)]
    return [each for each in found if isinstance(each, MissionItemInt)]


@pytest.mark.parametrize(("stack", "refusal"), STACKS)
def test_a_fence_is_kept_told_again_obeyed_and_cleared(stack: Stack, refusal: MavResult) -> None:
    station = flying(stack)
    hole = items(station, MavCmd.NAV_FENCE_CIRCLE_EXCLUSION, [(30.0, 0.0)], 10.0)
    assert upload(station, [*polygon(station), *hole]) == MavMissionResult.ACCEPTED
    assert [(each.command, each.x, each.y, each.param1) for each in download(station)] == [
        (each.command, each.x, each.y, each.param1) for each in [*polygon(station), *hole]
    ]
    here = station.vehicle.state.position_m
    for east_m in (60.0, 30.0):
        assert station.reposition(east_m, 0.0, 20.0) == refusal
        station.wait(3.0)
        assert math.dist(station.vehicle.state.position_m, here) < 1.0
    assert station.reposition(0.0, 45.0, 20.0) == MavResult.ACCEPTED
    station.wait(15.0)
    assert station.vehicle.state.position_m == pytest.approx((0.0, 45.0, 20.0), abs=0.5)
    one(station, MissionClearAll(mission_type=MavMissionType.ALL))
    assert download(station) == []
    assert station.reposition(60.0, 45.0, 20.0) == MavResult.ACCEPTED
    station.wait(15.0)
    assert station.vehicle.state.position_m == pytest.approx((60.0, 45.0, 20.0), abs=0.5)


@pytest.mark.parametrize(("stack", "one_is_enough"), [(px4, True), (ardupilot, False)])
def test_of_two_inclusions_px4_wants_one_and_ardupilot_both(stack: Stack, one_is_enough: bool) -> None:
    station = flying(stack)
    assert upload(station, [*polygon(station), *polygon(station, east_m=60.0)]) == MavMissionResult.ACCEPTED
    assert station.vehicle.fence.outside((-30.0, 0.0, 20.0)) != one_is_enough
    assert not station.vehicle.fence.outside((30.0, 0.0, 20.0))
    assert station.vehicle.fence.outside((150.0, 0.0, 20.0))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda fence: fence[:3],
        lambda fence: [fence[0], fence[2], fence[1], fence[3]],
        lambda fence: [replace(each, command=MavCmd.NAV_TAKEOFF) for each in fence],
        lambda fence: [replace(each, param1=math.nan) for each in fence],
        lambda fence: [replace(each, param1=math.inf) for each in fence],
        lambda fence: [replace(each, x=950000000) for each in fence],
        lambda fence: [replace(each, command=OUTSIDE if number else INSIDE) for number, each in enumerate(fence)],
    ],
)
def test_what_is_no_fence_is_refused_and_the_old_one_stays(
    spoil: Callable[[list[MissionItemInt]], list[MissionItemInt]],
) -> None:
    station = flying(px4)
    upload(station, polygon(station))
    assert upload(station, spoil(polygon(station, east_m=500.0))) == MavMissionResult.INVALID
    assert station.vehicle.fence.outside((500.0, 0.0, 20.0))
    assert len(download(station)) == 4


def test_an_item_that_comes_twice_counts_once_and_one_of_a_stranger_not_at_all() -> None:
    station = flying(px4)
    first, *_ = fence = polygon(station)
    wanted = one(station, MissionCount(count=4, mission_type=FENCE))
    for _ in range(2):
        wanted = one(station, replace(first, seq=0, mission_type=FENCE))
        assert isinstance(wanted, MissionRequestInt)
        assert wanted.seq == 1
    assert station.send(replace(fence[1], seq=1, mission_type=FENCE), STRANGER) == []
    assert one(station, MissionCount(count=1000, mission_type=FENCE)) == MissionAck(
        target_system=255, target_component=190, type=MavMissionResult.NO_SPACE, mission_type=FENCE
    )
