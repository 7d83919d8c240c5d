"""The parameter files agree with what hsop-gcs sends, asks for and keeps to."""

import pytest

from hsop_gcs.link.adapters.failsafes import ARDUPILOT_FAILSAFES, PX4_FAILSAFES, Relied
from hsop_gcs.link.identity import GROUND_STATION
from hsop_gcs.link.protocol.heartbeat import HEARTBEAT_PERIOD_S
from hsop_gcs.link.protocol.subscriptions import RATES_HZ
from tests.sitl import parameters

ARDUPILOT = ("sitl", "link", "failsafe", "fence", "gimbal")
PX4 = ("link", "failsafe", "fence", "gimbal-sih", "sitl")


def test_every_file_is_read_and_no_parameter_is_set_twice() -> None:
    folders = {"ardupilot": "parm", "px4": "params"}
    stems = {
        stack: {path.stem for path in (parameters.CONFIGS / stack).glob(f"*.{kind}")} for stack, kind in folders.items()
    }
    assert stems == {"ardupilot": set(ARDUPILOT), "px4": {*PX4, "gimbal-gz"}}
    assert len(parameters.ardupilot(*ARDUPILOT)) > 40
    assert len(parameters.px4(*PX4)) > 25
    assert parameters.px4("gimbal-gz")["MNT_MODE_IN"] == 4


def test_ardupilot_listens_for_our_heartbeat_under_both_names() -> None:
    link = parameters.ardupilot("link")
    assert link["MAV_GCS_SYSID"] == link["SYSID_MYGCS"] == GROUND_STATION.system
    assert link["MAV_GCS_SYSID_HI"] < link["MAV_GCS_SYSID"], "a range would take another station's heartbeat for ours"


def test_both_stacks_return_after_as_many_missing_heartbeats() -> None:
    ardupilot, px4 = parameters.ardupilot("failsafe"), parameters.px4("failsafe")
    assert ardupilot["FS_GCS_ENABLE"] == 1
    assert px4["NAV_DLL_ACT"] == 2
    assert ardupilot["FS_GCS_TIMEOUT"] == px4["COM_DL_LOSS_T"] == 10 * HEARTBEAT_PERIOD_S


@pytest.mark.parametrize(
    ("relied", "files"),
    [(PX4_FAILSAFES, parameters.px4("failsafe")), (ARDUPILOT_FAILSAFES, parameters.ardupilot("failsafe", "link"))],
)
def test_every_failsafe_that_the_service_looks_for_is_set_under_every_name_as_it_is_proposed(
    relied: tuple[Relied, ...], files: dict[str, float]
) -> None:
    for each in relied:
        assert {files[name] for name in each.names} == {each.set_to}
        assert each.fits(each.set_to)


def test_stages_of_an_empty_battery_come_in_order() -> None:
    ardupilot, px4 = parameters.ardupilot("failsafe"), parameters.px4("failsafe")
    assert ardupilot["BATT_CRT_VOLT"] < ardupilot["BATT_LOW_VOLT"] < ardupilot["BATT_ARM_VOLT"]
    assert px4["BAT_EMERGEN_THR"] < px4["BAT_CRIT_THR"] < px4["BAT_LOW_THR"] < px4["COM_ARM_BAT_MIN"]


def test_the_same_altitude_stands_in_centimetres_and_metres() -> None:
    failsafe = parameters.ardupilot("failsafe")
    assert failsafe["RTL_ALT"] == pytest.approx(100 * failsafe["RTL_ALT_M"])
    assert parameters.px4("failsafe")["RTL_RETURN_ALT"] == failsafe["RTL_ALT_M"]


def test_the_radio_link_has_room_for_what_we_ask_for() -> None:
    # A MAVLink 2 frame is 12 bytes longer than its payload; the longest payload of these messages has 60 bytes or so.
    assert parameters.px4("link")["MAV_0_RATE"] > sum(RATES_HZ.values()) * (12 + 60)
