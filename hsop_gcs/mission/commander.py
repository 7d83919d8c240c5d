"""What the mission has decided goes on the link: hover orders, and holds and recalls until hosts confirm them."""

import math
from collections.abc import Iterable, Mapping

from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.geometry.frames import Aim, LocalFrame
from hsop_gcs.link.pump import Link
from hsop_gcs.mission.core import Pending, Wish
from hsop_gcs.mission.dispatch import OrderProgress, WayGiven, evasion_order, hover_order
from hsop_gcs.mission.gates import Aircraft

_AGAIN_S = 6.0
"""After a command that was not confirmed; the link has tried it for five seconds by then."""


_EVADE_WITHIN_S = 3.0
"""A flight out of a threat's way that cannot be ordered within this is not ordered: the threat is elsewhere by then."""


class Commander:
    """Speaks to hosts; remembers nothing but when it told each of them to hold or return last."""

    def __init__(self, fleet: Fleet, frame: LocalFrame, link: Link) -> None:
        self._fleet = fleet
        self._frame = frame
        self._link = link
        self._told_s: dict[str, float] = {}

    def send(self, progress: OrderProgress, *, for_s: float) -> None:
        """Send a host to the next point of its way; the order is stale after ``for_s``."""
        (host,) = (host for host in self._fleet.hosts if host.id == progress.order.host)
        deadline_s, speed_mps = self._link.now() + for_s, self._fleet.limits.speed_mps
        self._link.hover(host.system_id, hover_order(progress, self._frame, deadline_s=deadline_s, speed_mps=speed_mps))

    def give_way(self, host: Host, way: WayGiven, *, heading_deg: float, aim: Aim | None) -> None:
        """Send a host out of a threat's way at full speed."""
        order = evasion_order(
            way,
            self._frame,
            heading_deg=heading_deg,
            aim=aim,
            deadline_s=self._link.now() + _EVADE_WITHIN_S,
            speed_mps=self._fleet.limits.speed_mps,
        )
        self._link.hover(host.system_id, order)

    def tell(self, hosts: Iterable[Host], wish: Wish) -> None:
        """Order hosts to hold or to return at once, whoever flies them.

        A recalled host on the ground is sent nothing, and its take-off under way is given up: a PX4 told to return
        while it stands stays in Return and refuses its next take-off.
        """
        for host in hosts:
            if wish is Wish.HOLD:
                self._link.hold(host.system_id)
            elif self.on_the_ground(host):
                self._link.leave_alone(host.system_id)
                continue
            else:
                self._link.return_to_launch(host.system_id)
            if self._link.vehicles[host.system_id].state.link_up:
                self._told_s[host.id] = self._link.now()

    def on_the_ground(self, host: Host) -> bool:
        """Whether a host is heard and says that it stands on the ground."""
        state = self._link.vehicles[host.system_id].state
        return state.link_up and state.in_air is False

    def insist(self, pending: Mapping[str, Pending], aircraft: Mapping[str, Aircraft]) -> None:
        """Order again what hosts have not confirmed, as far as they are heard and fly for us."""
        for host in self._fleet.hosts:
            if host.id not in pending or not aircraft[host.id].state.link_up:
                self._told_s.pop(host.id, None)
            elif aircraft[host.id].flies_for_us and self._link.now() >= self._told_s.get(host.id, -math.inf) + _AGAIN_S:
                self.tell([host], pending[host.id].wish)
