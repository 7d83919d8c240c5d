"""The parameters by which hosts come home by themselves: read, compared, told, on both stacks."""

import math
import struct

import pytest

from hsop_gcs.link.events import FailsafeNotSet
from hsop_gcs.link.messages import ParamRequestRead, ParamValue
from tests.link.two_ends import BAD, BOTH, PERFECT, Stack, TwoEnds

FAULTS: list[tuple[Stack, str, float, str]] = [
    ("px4", "NAV_DLL_ACT", 0, "it does not return when the ground station falls silent; set it to 2"),
    ("px4", "NAV_DLL_ACT", 1, "it does not return when the ground station falls silent; set it to 2"),
    ("px4", "COM_DLL_EXCEPT", 6, "in Hold, where hosts hover, it does not mind that the ground station is silent; "),
    ("px4", "COM_DL_LOSS_T", 300, "it notices too early or too late that the ground station is silent (seconds); "),
    ("px4", "COM_FAIL_ACT_T", 60.0, "it holds too long before it returns (seconds); set it to 5"),
    ("px4", "COM_LOW_BAT_ACT", 0, "it does not return when its battery is critical; set it to 3"),
    ("ardupilot", "FS_GCS_ENABLE", 0, "it does not return when the ground station falls silent; set it to 1"),
    ("ardupilot", "FS_GCS_ENABLE", 5, "it does not return when the ground station falls silent; set it to 1"),
    ("ardupilot", "FS_GCS_TIMEOUT", 1.0, "it notices too early or too late that the ground station is silent"),
    ("ardupilot", "FS_OPTIONS", 16, "in Brake, where a held host hovers, it does not mind that the ground station"),
    ("ardupilot", "MAV_GCS_SYSID", 250, "our heartbeat does not count as the ground station's; set it to 255"),
    ("ardupilot", "BATT_FS_LOW_ACT", 0, "it does not return when its battery is low; set it to 2"),
    ("ardupilot", "BATT_FS_CRT_ACT", 0, "it flies on when its battery is critical; set it to 1"),
]


@BOTH
@pytest.mark.parametrize("line", [PERFECT, BAD])
def test_failsafes_that_are_set_are_read_once_and_nothing_is_told(stack: Stack, line: object) -> None:
    ends = TwoEnds(stack, impairment=line)  # type: ignore[arg-type]
    ends.until(lambda: ends.vehicle.failsafes_checked, within_s=60.0)
    asked = len(asks(ends))
    ends.run(3.0)
    assert len(asks(ends)) == asked
    assert ends.vehicle.failsafe_problems == ()
    assert not ends.saw(FailsafeNotSet)


@pytest.mark.parametrize(("stack", "name", "value", "problem"), FAULTS)
def test_a_failsafe_that_will_not_work_is_told_once_with_the_fix(
    stack: Stack, name: str, value: float, problem: str
) -> None:
    ends = TwoEnds(stack)
    ends.sim.parameters._table[name].value = value
    ends.until(lambda: ends.vehicle.failsafes_checked)
    ends.run(5.0)
    (told,) = ends.vehicle.failsafe_problems
    assert told.startswith(f"{name} is {value:g}: {problem}")
    assert ends.of(FailsafeNotSet) == [FailsafeNotSet(system=1, problem=told)]


def test_a_parameter_that_somebody_sets_in_flight_is_compared_again() -> None:
    ends = TwoEnds("ardupilot")
    ends.until(lambda: ends.vehicle.failsafes_checked)
    ends.vehicle.receive(ParamValue(param_id="FS_GCS_ENABLE", param_value=0.0, param_type=2), ends.now)
    assert [each.split(":")[0] for each in ends.vehicle.failsafe_problems] == ["FS_GCS_ENABLE is 0"]
    ends.vehicle.receive(ParamValue(param_id="FS_GCS_ENABLE", param_value=1.0, param_type=2), ends.now)
    assert ends.vehicle.failsafe_problems == ()


def test_the_older_name_of_a_parameter_counts_where_the_newer_is_not_known() -> None:
    ends = TwoEnds("ardupilot")
    table = ends.sim.parameters._table
    ends.sim.parameters._table = {
        "SYSID_MYGCS" if name == "MAV_GCS_SYSID" else name: value for name, value in table.items()
    }
    ends.sim.parameters._names = list(ends.sim.parameters._table)
    ends.until(lambda: ends.vehicle.failsafes_checked)
    assert ends.vehicle.failsafe_problems == ()
    assert {"MAV_GCS_SYSID", "SYSID_MYGCS"} <= {ask.param_id for ask in asks(ends)}


def test_what_is_not_told_is_told_and_asked_for_again_a_minute_later() -> None:
    ends = TwoEnds("ardupilot")
    table = ends.sim.parameters._table
    relied = {name for _, name, _, _ in FAULTS} & set(table)
    kept = {name: table.pop(name) for name in relied}
    ends.until(lambda: ends.vehicle.failsafes_checked)
    assert len(ends.vehicle.failsafe_problems) == len(relied)
    assert all("is not told: it may be that" in problem for problem in ends.vehicle.failsafe_problems)
    table |= kept
    ends.until(lambda: ends.vehicle.failsafe_problems == (), within_s=90.0)


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, -1.0, 1e30])
def test_a_number_that_is_none_fits_nothing_and_parameters_that_nobody_relies_on_are_left(value: float) -> None:
    ends = TwoEnds("ardupilot")
    ends.until(lambda: ends.vehicle.failsafes_checked)
    for name in ("FS_GCS_ENABLE", "FS_GCS_TIMEOUT", "FS_OPTIONS", "WPNAV_SPEED"):
        ends.vehicle.receive(ParamValue(param_id=name, param_value=value, param_type=9), ends.now)
    names = [problem.split(" ")[0] for problem in ends.vehicle.failsafe_problems]
    assert names[:2] == ["FS_GCS_ENABLE", "FS_GCS_TIMEOUT"]
    assert "WPNAV_SPEED" not in names


def test_an_integer_of_px4_is_read_from_its_bits() -> None:
    ends = TwoEnds("px4")
    ends.until(lambda: ends.vehicle.failsafes_checked)
    minus_one: float = struct.unpack("<f", struct.pack("<i", -1))[0]
    ends.vehicle.receive(ParamValue(param_id="COM_DLL_EXCEPT", param_value=minus_one, param_type=6), ends.now)
    (problem,) = ends.vehicle.failsafe_problems
    assert problem.startswith("COM_DLL_EXCEPT is -1: ")


def asks(ends: TwoEnds) -> list[ParamRequestRead]:
    return [frame.message for _, frame in ends.heard if isinstance(frame.message, ParamRequestRead)]
