"""Where hosts were and how they were turned, of late: for what their cameras will say they saw then."""

import asyncio
import logging

from hsop_gcs.detections import PoseHistory
from hsop_gcs.fleet import Fleet
from hsop_gcs.geometry.frames import LocalFrame
from hsop_gcs.link.protocol.telemetry import VehicleState
from hsop_gcs.link.pump import Link
from hsop_gcs.mission.clock import MissionClock
from hsop_gcs.mission.own_paths import OwnPaths

_STEP_S = 0.025

log = logging.getLogger(__name__)


class Poses:
    """The histories of a fleet's hosts, by id, on the mission's clock."""

    def __init__(self, fleet: Fleet, frame: LocalFrame, link: Link, clock: MissionClock) -> None:
        self.histories = {host.id: PoseHistory() for host in fleet.hosts}
        self.faults: dict[str, str] = {}
        """Hosts whose telemetry makes no pose now, and why."""
        self.paths = OwnPaths(host.id for host in fleet.hosts)
        self._fleet = fleet
        self._frame = frame
        self._link = link
        self._clock = clock

    async def watch(self) -> None:
        """Keep the histories until cancelled."""
        seen: dict[str, VehicleState] = {}
        while True:
            ahead_s = self._clock() - self._link.now()
            for host in self._fleet.hosts:
                state, before = self._link.vehicles[host.system_id].state, seen.get(host.id)
                history = self.histories[host.id]
                try:
                    after = with_telemetry(history, state, self._frame, ahead_s=ahead_s, before=before)
                except Exception as error:  # what one host says costs no other its poses
                    if host.id not in self.faults:
                        log.exception("host %s: its poses are not kept", host.id)
                    self.faults[host.id] = f"{type(error).__name__}: {error}"
                    continue
                self.faults.pop(host.id, None)
                self.histories[host.id], seen[host.id] = after, state
                if after.positions and after.positions is not history.positions:
                    self.paths.note(host.id, *after.positions[-1])
            await asyncio.sleep(_STEP_S)


def with_telemetry(
    history: PoseHistory, state: VehicleState, frame: LocalFrame, *, ahead_s: float, before: VehicleState | None
) -> PoseHistory:
    """Return a host's pose history with what its telemetry says now.

    ahead_s: our clock minus the link's. before: the state that the history already holds, None for a new history.
    """
    known = before or VehicleState(system=state.system)
    if state.position is not None and state.position_heard_s not in (None, known.position_heard_s):
        east, north, up = frame.to_enu(state.position).tolist()
        history = history.with_position(state.position_heard_s + ahead_s, (east, north, up))
    if state.heading_deg is not None and state.attitude_heard_s not in (None, known.attitude_heard_s):
        history = history.with_attitude(
            state.attitude_heard_s + ahead_s,
            heading_deg=state.heading_deg,
            roll_deg=state.roll_deg or 0.0,
            pitch_deg=state.pitch_deg or 0.0,
        )
    if state.gimbal is not None and state.gimbal_heard_s not in (None, known.gimbal_heard_s):
        history = history.with_aim(state.gimbal_heard_s + ahead_s, state.gimbal)
    return history
