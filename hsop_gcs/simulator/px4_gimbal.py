"""PX4's gimbal manager: only its primary controller is obeyed, only the lock flags count, limits are told in degrees.

Sources: a recording of v1.16.0; PX4-Autopilot gimbal/input_mavlink.cpp.
"""

import math

from hsop_gcs.link.enums import GimbalFlags, MavCmd, MavResult
from hsop_gcs.link.messages import (
    CommandLong,
    GimbalDeviceAttitudeStatus,
    GimbalManagerInformation,
    GimbalManagerSetAttitude,
)
from hsop_gcs.simulator.gimbal import Identity, pitch_yaw, quaternion
from hsop_gcs.simulator.gimbal_manager import LEVEL, GimbalManager
from hsop_gcs.simulator.orders import Order, whole

_LOCK_FLAGS = LEVEL | GimbalFlags.YAW_LOCK


class Px4GimbalManager(GimbalManager):
    """Orders to a PX4's gimbal, and its reports."""

    def set_attitude(self, message: GimbalManagerSetAttitude, sender: Identity) -> None:
        """Obey a stream of attitudes; one that is not the primary controller's is dropped in silence."""
        if sender == self._vehicle.gimbal.primary:
            rates = (message.angular_velocity_y, message.angular_velocity_z)
            self._point(message.flags, *pitch_yaw(message.q), *rates)

    def stow_for_return(self) -> None:
        """Take the gimbal, level it and let go of it, as the navigator does by commands of its own."""
        me = (self._vehicle.config.system, 1)
        for command, p1, p2, p5 in (
            (MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, *me, 0.0),
            (MavCmd.DO_GIMBAL_MANAGER_PITCHYAW, math.nan, math.nan, GimbalFlags.NEUTRAL),
            (MavCmd.DO_GIMBAL_MANAGER_CONFIGURE, -3, -3, 0.0),
        ):
            rest = math.nan if command == MavCmd.DO_GIMBAL_MANAGER_PITCHYAW else -1.0
            self._vehicle.later(
                CommandLong(
                    target_system=me[0], command=command, param1=p1, param2=p2, param3=rest, param4=rest, param5=p5
                )
            )
        gimbal = self._vehicle.gimbal
        gimbal.configure(me, (-1, -1), sender=me, me=me)
        self._point(GimbalFlags.NEUTRAL, math.nan, math.nan, math.nan, math.nan)
        gimbal.configure((-3, -3), (-1, -1), sender=me, me=me)

    def _pitch_yaw(self, order: Order) -> MavResult:
        if order.sender != self._vehicle.gimbal.primary:
            return MavResult.DENIED
        flags = whole(order.lat_deg)
        self._point(flags, math.radians(order.p1), math.radians(order.p2), order.p3, order.p4)
        return MavResult.ACCEPTED

    def _point(self, flags: int, pitch_rad: float, yaw_rad: float, pitch_rad_s: float, yaw_rad_s: float) -> None:
        """Aim as the lock flags say. Retract is not implemented, neither here nor there."""
        if flags & GimbalFlags.RETRACT:
            return
        self._vehicle.roi = None
        gimbal = self._vehicle.gimbal
        if flags & GimbalFlags.NEUTRAL:
            self._flags = LEVEL
            gimbal.point(pitch_rad=0.0, yaw_rad=0.0, locked=False)
            return
        self._flags = GimbalFlags(flags & _LOCK_FLAGS)
        locked = bool(flags & GimbalFlags.YAW_LOCK)
        if math.isfinite(pitch_rad_s) or math.isfinite(yaw_rad_s):
            rates = [rate if math.isfinite(rate) else 0.0 for rate in (pitch_rad_s, yaw_rad_s)]
            gimbal.turn(pitch_rad_s=rates[0], yaw_rad_s=rates[1], locked=locked)
        else:
            gimbal.point(pitch_rad=_finite(pitch_rad), yaw_rad=_finite(yaw_rad), locked=locked)

    def _configure(self, order: Order) -> MavResult:
        """Primary control only; "-2" means this autopilot, not the sender."""
        me = (self._vehicle.config.system, 1)
        self._vehicle.gimbal.configure((order.p1, order.p2), (-1, -1), sender=order.sender, me=me)
        return MavResult.ACCEPTED

    def _set_roi(self, order: Order) -> MavResult:
        """Look at a place whoever is in control; the altitude is AMSL whatever the frame says."""
        place = (order.lat_deg, order.lon_deg, order.z)
        if not all(map(math.isfinite, place)):
            return MavResult.DENIED
        self._vehicle.roi = self._vehicle.place_of(*place)
        self._flags = LEVEL | GimbalFlags.YAW_LOCK
        return MavResult.ACCEPTED

    def _clear_roi(self, order: Order) -> MavResult:  # noqa: ARG002
        self._point(GimbalFlags.NEUTRAL, math.nan, math.nan, math.nan, math.nan)
        return MavResult.ACCEPTED

    def _information(self) -> GimbalManagerInformation:
        """Degrees, where the message's definition wants radians, and the whole range to either side."""
        limits = self._vehicle.config.gimbal
        pitch = (math.degrees(limits.pitch_min_rad), math.degrees(limits.pitch_max_rad))
        told = 2.0 if pitch[0] == -pitch[1] else 1.0
        return GimbalManagerInformation(
            time_boot_ms=self._vehicle.boot_ms,
            cap_flags=132530,
            gimbal_device_id=1,
            pitch_min=told * pitch[0],
            pitch_max=told * pitch[1],
            yaw_min=2.0 * math.degrees(limits.yaw_min_rad),
            yaw_max=2.0 * math.degrees(limits.yaw_max_rad),
        )

    def _attitude(self) -> GimbalDeviceAttitudeStatus:
        """Yaw is against north when locked, else against the nose; neither frame bit says so."""
        gimbal = self._vehicle.gimbal
        yaw_rad = gimbal.earth_yaw_rad if gimbal.locked else gimbal.yaw_rad
        return GimbalDeviceAttitudeStatus(
            time_boot_ms=self._vehicle.boot_ms,
            flags=self._flags,
            q=quaternion(pitch_rad=gimbal.pitch_rad, yaw_rad=yaw_rad),
            gimbal_device_id=1,
        )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
