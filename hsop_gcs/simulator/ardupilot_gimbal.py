"""ArduPilot's gimbal manager: it obeys anybody, and of the flags only the yaw lock counts.

Attitudes are always told against the nose; angles beyond the range are ACCEPTED and clamped.
Sources: a recording of 4.7.0-dev; AP_Mount_Backend.cpp.
"""

import math
from collections.abc import Callable

from hsop_gcs.link.enums import GimbalFlags, MavFrame, MavResult
from hsop_gcs.link.messages import (
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerSetAttitude,
    GimbalManagerSetPitchyaw,
)
from hsop_gcs.simulator.flight import Point
from hsop_gcs.simulator.gimbal import GimbalLimits, pitch_yaw, quaternion
from hsop_gcs.simulator.gimbal_manager import LEVEL, GimbalManager
from hsop_gcs.simulator.orders import Order, whole
from hsop_gcs.simulator.vehicle import Vehicle


def rest_pitch_rad(limits: GimbalLimits) -> float:
    """Steered by a remote control whose stick is centred: the middle of the range."""
    return (limits.pitch_min_rad + limits.pitch_max_rad) / 2


class ArduPilotGimbalManager(GimbalManager):
    """Orders to an ArduPilot's gimbal, and its reports.

    target: frame, latitude, longitude (degrees) and altitude (m) of an order to local ENU, None where it is refused.
    """

    def __init__(self, vehicle: Vehicle, target: Callable[[int, float, float, float], Point | None]) -> None:
        super().__init__(vehicle)
        self._target = target

    def set_pitch_yaw(self, message: GimbalManagerSetPitchyaw) -> None:
        rates = (message.pitch_rate, message.yaw_rate)
        self._steer(message.flags, message.gimbal_device_id, (message.pitch, message.yaw), rates)

    def set_attitude(self, message: GimbalManagerSetAttitude) -> None:
        rates = (message.angular_velocity_y, message.angular_velocity_z)
        self._steer(message.flags, message.gimbal_device_id, pitch_yaw(message.q), rates)

    def _pitch_yaw(self, order: Order) -> MavResult:
        angles = (math.radians(order.p1), math.radians(order.p2))
        return self._steer(whole(order.x), whole(order.z), angles, (math.radians(order.p3), math.radians(order.p4)))

    def _steer(self, flags: int, gimbal_id: int, angles: tuple[float, float], rates: tuple[float, float]) -> MavResult:
        """Obey anybody: both angles if they are numbers, else both rates, else it is nothing. Only YAW_LOCK counts."""
        locked = bool(flags & GimbalFlags.YAW_LOCK)
        gimbal = self._vehicle.gimbal
        if gimbal_id not in (0, 1):
            return MavResult.FAILED
        if flags & (GimbalFlags.NEUTRAL | GimbalFlags.RETRACT):
            gimbal.point(pitch_rad=0.0, yaw_rad=0.0, locked=False)
        elif all(map(math.isfinite, angles)):
            gimbal.point(pitch_rad=angles[0], yaw_rad=angles[1], locked=locked)
        elif all(map(math.isfinite, rates)):
            gimbal.turn(pitch_rad_s=rates[0], yaw_rad_s=rates[1], locked=locked)
        else:
            return MavResult.FAILED
        self._vehicle.roi = None
        return MavResult.ACCEPTED

    def _configure(self, order: Order) -> MavResult:
        """Remember who is in control, tell it at once, and enforce nothing; "-2" means the sender."""
        if whole(order.z) not in (0, 1):
            return MavResult.FAILED
        me = order.sender
        self._vehicle.gimbal.configure((order.p1, order.p2), (-1, -1), sender=order.sender, me=me)
        self._vehicle.later(self._status())
        return MavResult.ACCEPTED

    def _set_roi(self, order: Order) -> MavResult:
        frame = order.frame if order.integer else MavFrame.GLOBAL_RELATIVE_ALT
        target = self._target(frame, order.lat_deg, order.lon_deg, order.z)
        if target is None:
            return MavResult.DENIED
        self._vehicle.roi = target
        return MavResult.ACCEPTED

    def _clear_roi(self, order: Order) -> MavResult:  # noqa: ARG002
        self._vehicle.roi = None
        self._vehicle.gimbal.point(pitch_rad=rest_pitch_rad(self._vehicle.config.gimbal), yaw_rad=0.0, locked=False)
        return MavResult.ACCEPTED

    def _information(self) -> GimbalManagerInformation:
        limits = self._vehicle.config.gimbal
        return GimbalManagerInformation(
            time_boot_ms=self._vehicle.boot_ms,
            cap_flags=206847,
            gimbal_device_id=1,
            roll_min=math.radians(-30),
            roll_max=math.radians(30),
            pitch_min=limits.pitch_min_rad,
            pitch_max=limits.pitch_max_rad,
            yaw_min=limits.yaw_min_rad,
            yaw_max=limits.yaw_max_rad,
        )

    def _attitude(self) -> GimbalDeviceAttitudeStatus:
        """Always against the nose, and it says so; rates and the angle to north are not told."""
        gimbal = self._vehicle.gimbal
        flags = LEVEL | GimbalFlags.YAW_IN_VEHICLE_FRAME
        if gimbal.locked:
            flags |= GimbalFlags.YAW_LOCK
        return GimbalDeviceAttitudeStatus(
            time_boot_ms=self._vehicle.boot_ms,
            flags=flags,
            q=quaternion(pitch_rad=gimbal.pitch_rad, yaw_rad=gimbal.yaw_rad),
            angular_velocity_x=math.nan,
            angular_velocity_y=math.nan,
            angular_velocity_z=math.nan,
            delta_yaw=math.nan,
            delta_yaw_velocity=math.nan,
            gimbal_device_id=1,
        )
