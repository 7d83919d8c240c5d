"""A battery that drains with the time in the air, and the level at which a stack begins to worry."""

from dataclasses import dataclass

from hsop_gcs.link.enums import MavBatteryChargeState


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryConfig:
    """``endurance_s``: flight time from full to empty. ``percent``: charge at the start."""

    endurance_s: float = 25 * 60.0
    percent: float = 100.0
    capacity_mah: float = 5000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Charge below which a level begins, percent; 0 for a level that a stack does not have."""

    low: float = 0.0
    critical: float = 0.0
    emergency: float = 0.0


class Battery:
    """One battery; a level that was reached is not left again."""

    def __init__(self, config: BatteryConfig) -> None:
        self._config = config
        self._charge_percent = config.percent
        self.level = MavBatteryChargeState.OK

    @property
    def percent(self) -> float:
        return max(0.0, self._charge_percent)

    @property
    def used_mah(self) -> float:
        return (100.0 - self.percent) / 100.0 * self._config.capacity_mah

    @property
    def voltage_mv(self) -> int:
        """Of four cells, falling evenly with the charge."""
        return round(14000 + 28 * self.percent)

    def __str__(self) -> str:
        return f"{self.voltage_mv / 1000:.2f}V used {self.used_mah:.0f} mAh"

    def drain(self, flown_s: float, thresholds: Thresholds) -> bool:
        """Fly so long; returns whether that has brought it to a worse level."""
        self._charge_percent -= 100.0 * flown_s / self._config.endurance_s
        level = MavBatteryChargeState.OK
        if self.percent < thresholds.low:
            level = MavBatteryChargeState.LOW
        if self.percent < thresholds.critical:
            level = MavBatteryChargeState.CRITICAL
        if self.percent < thresholds.emergency:
            level = MavBatteryChargeState.EMERGENCY
        fell = level > self.level
        self.level = max(self.level, level)
        return fell
