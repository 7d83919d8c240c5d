"""Copter's parameters, those that change what the simulated one does, and what its battery failsafe makes of them."""

from hsop_gcs.link.enums import MavBatteryChargeState
from hsop_gcs.simulator.ardupilot_modes import Mode
from hsop_gcs.simulator.battery import Thresholds
from hsop_gcs.simulator.body import VehicleConfig
from hsop_gcs.simulator.parameters import INT8, INT16, INT32, Parameter, Parameters

_ACT_LAND, _ACT_RTL = 1, 2


def fresh_parameters(config: VehicleConfig) -> Parameters:
    """Return the parameters of a vehicle that nobody has set up."""
    return Parameters(
        {
            "SYSID_THISMAV": Parameter(config.system, INT8),
            "WPNAV_SPEED": Parameter(config.flight.cruise_mps * 100),
            "WP_YAW_BEHAVIOR": Parameter(2, INT8),
            "RTL_ALT": Parameter(1500),
            "FENCE_ENABLE": Parameter(0, INT8),
            "FENCE_TYPE": Parameter(7, INT8),
            "FENCE_RADIUS": Parameter(300.0),
            "FENCE_ALT_MAX": Parameter(100.0),
            "FENCE_ALT_MIN": Parameter(-10.0),
            "BATT_CAPACITY": Parameter(config.battery.capacity_mah),
            "BATT_LOW_MAH": Parameter(0.2 * config.battery.capacity_mah),
            "BATT_CRT_MAH": Parameter(0.1 * config.battery.capacity_mah),
            "BATT_FS_LOW_ACT": Parameter(_ACT_RTL, INT8),
            "BATT_FS_CRT_ACT": Parameter(_ACT_LAND, INT8),
            # told as failsafe.parm and link.parm set them: a simulated vehicle does not mind a silent ground station
            "FS_GCS_ENABLE": Parameter(1, INT8),
            "FS_GCS_TIMEOUT": Parameter(10.0),
            "FS_OPTIONS": Parameter(8, INT32),
            "MAV_GCS_SYSID": Parameter(255, INT16),
            "MAV_GCS_SYSID_HI": Parameter(0, INT16),
        },
        bytewise=False,
    )


def battery_thresholds(parameters: Parameters) -> Thresholds:
    low, critical = (100 * parameters[name] / parameters["BATT_CAPACITY"] for name in ("BATT_LOW_MAH", "BATT_CRT_MAH"))
    return Thresholds(low=low, critical=critical)


def battery_failsafe(parameters: Parameters, level: MavBatteryChargeState) -> Mode | None:
    """Return what BATT_FS_LOW_ACT or BATT_FS_CRT_ACT says: land, return, or nothing."""
    act = parameters["BATT_FS_LOW_ACT" if level == MavBatteryChargeState.LOW else "BATT_FS_CRT_ACT"]
    return {_ACT_LAND: Mode.LAND, _ACT_RTL: Mode.RTL}.get(round(act))
