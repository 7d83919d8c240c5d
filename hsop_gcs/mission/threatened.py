"""Hosts that threats come near to and that do not give way: what people have been told of, and what still holds."""

from hsop_gcs.mission.inputs import HostThreatened

_NEARER_M = 5.0
"""By so much nearer than was told is news."""
_FORGOTTEN_S = 3.0
"""After so long a threat is not coming near any more."""


class Threatened:
    """The newest of each host."""

    def __init__(self) -> None:
        self._told: dict[str, HostThreatened] = {}
        self._newest: dict[str, HostThreatened] = {}

    def is_news(self, given: HostThreatened) -> bool:
        """Take what is found now; return whether people have not been told of it yet."""
        told, before = self._told.get(given.host), self._newest.get(given.host)
        self._newest[given.host] = given
        if (
            told is not None
            and before is not None
            and given.time_s <= before.time_s + _FORGOTTEN_S
            and (given.threat, given.reason) == (told.threat, told.reason)
            and given.distance_m > told.distance_m - _NEARER_M
        ):
            return False
        self._told[given.host] = given
        return True

    def problems(self, now_s: float) -> list[str]:
        """Return what threatens hosts now, for a person."""
        return [
            f"host {each.host}: threat {each.threat} comes within {each.distance_m:.0f} m of it, and it stays:"
            f" {each.reason}"
            for each in self._newest.values()
            if now_s <= each.time_s + _FORGOTTEN_S
        ]
