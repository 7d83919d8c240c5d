"""What the gimbal managers of both stacks are asked and report; how they obey and word it, their own modules say."""

from hsop_gcs.link.enums import GimbalFlags, MavCmd, MavResult
from hsop_gcs.link.messages import GimbalDeviceAttitudeStatus, GimbalManagerInformation, GimbalManagerStatus
from hsop_gcs.simulator.orders import Order
from hsop_gcs.simulator.vehicle import Handler, Sampler, Vehicle

LEVEL = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK


class GimbalManager:
    """Orders to a vehicle's gimbal, and its reports."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._flags = LEVEL
        """As the manager reports them."""

    @property
    def commands(self) -> dict[int, Handler]:
        return {
            MavCmd.DO_GIMBAL_MANAGER_PITCHYAW: self._pitch_yaw,
            MavCmd.DO_GIMBAL_MANAGER_CONFIGURE: self._configure,
            MavCmd.DO_SET_ROI_LOCATION: self._set_roi,
            MavCmd.DO_SET_ROI_NONE: self._clear_roi,
        }

    @property
    def samplers(self) -> dict[int, Sampler]:
        return {
            GimbalDeviceAttitudeStatus.ID: self._attitude,
            GimbalManagerStatus.ID: self._status,
            GimbalManagerInformation.ID: self._information,
        }

    def _status(self) -> GimbalManagerStatus:
        primary = self._vehicle.gimbal.primary
        return GimbalManagerStatus(
            time_boot_ms=self._vehicle.boot_ms,
            flags=self._flags,
            gimbal_device_id=1,
            primary_control_sysid=primary[0],
            primary_control_compid=primary[1],
        )

    # What a stack must say

    def _pitch_yaw(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _configure(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _set_roi(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _clear_roi(self, order: Order) -> MavResult:
        raise NotImplementedError

    def _attitude(self) -> GimbalDeviceAttitudeStatus:
        raise NotImplementedError

    def _information(self) -> GimbalManagerInformation:
        raise NotImplementedError
