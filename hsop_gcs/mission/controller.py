"""The mission's shell: owns the picture, the plans and the orders, and moves them on as time and events come in.

Everything it decides is decided by pure functions (``pipeline``, ``state``, ``dispatch``, ``tracks``); here they meet
the clock, the link and the solver's process.
"""

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from hsop_gcs.assignment import Mover
from hsop_gcs.assignment.orders import clearance_m
from hsop_gcs.errors import NotKnown, Refused
from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.link.events import Event, OrderEvent
from hsop_gcs.link.pump import Link
from hsop_gcs.link.vehicle import Vehicle
from hsop_gcs.mission.dispatch import OrderProgress, hover_order, mover_of, progressed
from hsop_gcs.mission.pipeline import PlanningRules, Situation
from hsop_gcs.mission.solver import Solver
from hsop_gcs.mission.state import (
    Autonomy,
    MissionState,
    Plan,
    ReplanRules,
    ready,
    replan_reason,
    with_decision,
    with_proposal_flying,
    without_threats,
)
from hsop_gcs.placement.problem import Threat
from hsop_gcs.reports import Measurement, ReportRules, Site, Vector3
from hsop_gcs.tracks import Picture, Refusal, TrackRules, TrackStatus, Verdict, prune, update

_TICK_S = 0.2
_EVENTS_KEPT = 500

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedEvent:
    """An event of a host, for people and for the record; numbers rise by one."""

    number: int
    time_s: float
    host: str
    event: Event


class Mission:
    """One mission from its first report to its last order. ``clock``: seconds since the Unix epoch."""

    def __init__(
        self,
        *,
        fleet: Fleet,
        site: Site,
        link: Link,
        solver: Solver,
        clock: Callable[[], float],
        autonomy: Autonomy = Autonomy.CONFIRM,
        planning: PlanningRules | None = None,
        replanning: ReplanRules | None = None,
        track_rules: TrackRules | None = None,
        report_rules: ReportRules | None = None,
    ) -> None:
        self.fleet = fleet
        self.site = site
        self.link = link
        self.autonomy = autonomy
        self.planning = planning or PlanningRules()
        self.replanning = replanning or ReplanRules()
        self.report_rules = report_rules or ReportRules()
        self.clock = clock
        self.picture = Picture()
        self.state = MissionState()
        self.progress: dict[str, OrderProgress] = {}
        """The newest order of each host."""
        self.events: deque[LoggedEvent] = deque(maxlen=_EVENTS_KEPT)
        self.reports_accepted = 0
        self.reports_refused: Counter[str] = Counter()
        """Refused reports by the field that was at fault."""
        self.solver_fault: str | None = None
        """What went wrong in the solver's process, if its last run did not end in an answer."""
        self._track_rules = track_rules or TrackRules()
        self._solver = solver
        self._solving: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()

    # What consoles ask for

    def submit(self, measurements: Sequence[Measurement]) -> tuple[Verdict, ...]:
        """Take measurements that arrived together into the picture; return what became of each, in their order."""
        self.picture, verdicts = update(
            self.picture,
            measurements,
            self.clock(),
            self._track_rules,
            hosts_m=self._hosts_m(),
            clock=self.report_rules,
        )
        for verdict in verdicts:
            if isinstance(verdict, Refusal):
                self.refuse_report(verdict.field)
            else:
                self.reports_accepted += 1
        self._changed.set()
        return verdicts

    def refuse_report(self, field: str) -> None:
        """Count a report that was refused before it got here."""
        self.reports_refused[field] += 1

    def approve(self, plan_id: str) -> Plan:
        """Let the proposed plan fly. Raises NotKnown, or Refused if it is not the proposal any more or not safe now."""
        plan = self.state.proposed
        known = {each.id for each in (plan, self.state.flying, self.state.failed) if each is not None}
        if plan is None or plan.id != plan_id:
            if plan_id in known:
                raise Refused(f"plan {plan_id} is not waiting for approval")
            raise NotKnown(f"plan {plan_id!r}: there is no such plan" + (f"; {plan.id} is proposed" if plan else ""))
        if self.autonomy is Autonomy.ADVISE:
            raise Refused("this service only advises: plans are not flown")
        self._fly()
        return plan

    def take_off(self, altitude_m: float, host_ids: Iterable[str] | None = None) -> list[str]:
        """Order hosts into the air, ``altitude_m`` above their homes; return their ids. Only an operator does this."""
        hosts = self._hosts(host_ids)
        for host in hosts:
            self.link.take_off(host.system_id, altitude_m)
        return [host.id for host in hosts]

    def hold(self, host_ids: Iterable[str] | None = None) -> list[str]:
        """Stop hosts where they are; return their ids. From then on no plan flies without a person's approval."""
        hosts = self._hosts(host_ids)
        for host in hosts:
            self.link.hold(host.system_id)
            self.progress.pop(host.id, None)
        if self.autonomy is Autonomy.AUTO:
            self.autonomy = Autonomy.CONFIRM
        return [host.id for host in hosts]

    def vehicle(self, host: Host) -> Vehicle:
        """Return the host's end of the link: its telemetry and how its order stands."""
        return self.link.vehicles[host.system_id]

    def unavailable(self) -> dict[str, str]:
        """Return why each host that cannot be sent cannot be sent."""
        now = self.link.now()
        reasons = {host.id: self.vehicle(host).why_not_ready(now) for host in self.fleet.hosts}
        return {host_id: reason for host_id, reason in reasons.items() if reason is not None}

    # What time brings

    async def run(self) -> None:
        """Move the mission on until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch_link())
            while True:
                self._advance(tasks)
                self._changed.clear()
                try:
                    await asyncio.wait_for(self._changed.wait(), _TICK_S)
                except TimeoutError:
                    continue

    def _advance(self, tasks: asyncio.TaskGroup) -> None:
        now_s = self.clock()
        self.picture, gone = prune(self.picture, now_s, self._track_rules)
        for track in gone:
            log.info("threat %s has not been reported for %.0f s: it has left", track.id, now_s - track.time_s)
        if gone and not self.picture.tracks:
            self.state = without_threats(self.state)
        if self._solving is None:
            self._replan_if_due(tasks, now_s)

    def _replan_if_due(self, tasks: asyncio.TaskGroup, now_s: float) -> None:
        believed = tuple(track for track in self.picture.tracks.values() if track.status is not TrackStatus.TENTATIVE)
        tracks = ready(believed, now_s, self.replanning)
        movers = self._movers()
        available = frozenset(mover.id for mover in movers)
        reason = replan_reason(self.state, tracks, available, now_s, self.replanning)
        if reason is not None:
            situation = Situation(now_s=now_s, tracks=tracks, movers=movers)
            self._solving = tasks.create_task(self._solve(situation, reason))

    async def _solve(self, situation: Situation, reason: str) -> None:
        try:
            decision = await self._solver.decide(situation, self.planning)
        except Exception as error:  # whatever the solver does, the service goes on and says so
            self.solver_fault = f"{type(error).__name__}: {error}"
            log.exception("the solver failed")
            await asyncio.sleep(self.replanning.retry_s)
            return
        else:
            self.solver_fault = None
            self.state = with_decision(
                self.state, decision, trigger=reason, now_s=self.clock(), horizon_s=self.planning.horizon_s
            )
            if self.autonomy is Autonomy.AUTO and self.state.proposed is not None:
                self._fly_at_once(self.state.proposed)
        finally:
            self._solving = None
            self._changed.set()

    def _fly_at_once(self, plan: Plan) -> None:
        try:
            self._fly()
        except Refused as error:
            log.warning("plan %s does not fly: %s", plan.id, error)

    def _fly(self) -> None:
        """Send the proposed plan's orders, all or none."""
        plan = self.state.proposed
        assert plan is not None
        now_s = self.clock()
        if now_s > plan.expires_at_s:
            raise Refused(f"plan {plan.id} ran out {now_s - plan.expires_at_s:.1f} s ago")
        movers = {mover.id: mover for mover in self._movers()}
        threats = self._threats_now(now_s)
        for order in plan.decision.orders:
            if order.host not in movers:
                raise Refused(f"host {order.host}: {self.unavailable().get(order.host, 'not available')}")
            clear_m = clearance_m(movers[order.host], order.position_m, threats, horizon_s=self.planning.horizon_s)
            if clear_m < self.planning.safety_distance_m:
                raise Refused(
                    f"host {order.host} would pass within {clear_m:.1f} m of a threat;"
                    f" the safety distance is {self.planning.safety_distance_m:g} m"
                )
        self.state = with_proposal_flying(self.state)
        for order in plan.decision.orders:
            host = next(host for host in self.fleet.hosts if host.id == order.host)
            order_id = f"{plan.id}/{host.id}"
            self.progress[host.id] = OrderProgress(order_id=order_id, plan_id=plan.id, order=order)
            self.link.hover(
                host.system_id,
                hover_order(
                    order,
                    order_id,
                    self.site.frame,
                    deadline_s=self.link.now() + plan.expires_at_s - now_s,
                    speed_mps=self.planning.limits.speed_mps,
                ),
            )

    async def _watch_link(self) -> None:
        while True:
            event = await self.link.events.get()
            host = self.fleet.host_of_system(event.system)
            number = self.events[-1].number + 1 if self.events else 1
            self.events.append(LoggedEvent(number=number, time_s=self.clock(), host=host.id, event=event))
            progress = self.progress.get(host.id)
            if progress is not None and isinstance(event, OrderEvent) and event.order_id == progress.order_id:
                self.progress[host.id] = progressed(progress, event)
            self._changed.set()

    def _movers(self) -> tuple[Mover, ...]:
        unavailable = self.unavailable()
        return tuple(
            mover_of(host.id, self.vehicle(host).state, self.site.frame, self.fleet.limits)
            for host in self.fleet.hosts
            if host.id not in unavailable
        )

    def _hosts_m(self) -> dict[str, Vector3]:
        """Where our own aircraft are, as far as they are heard: nothing there is a threat."""
        places: dict[str, Vector3] = {}
        for host in self.fleet.hosts:
            state = self.vehicle(host).state
            if state.link_up and state.position is not None:
                east, north, up = self.site.frame.to_enu(state.position).tolist()
                places[host.id] = (east, north, up)
        return places

    def _threats_now(self, now_s: float) -> tuple[Threat, ...]:
        return tuple(
            Threat(
                id=track.id, position_m=track.position_at(now_s), velocity_mps=track.velocity_mps, size_m=track.size_m
            )
            for track in self.picture.tracks.values()
        )

    def _hosts(self, host_ids: Iterable[str] | None) -> list[Host]:
        by_id = {host.id: host for host in self.fleet.hosts}
        wanted = list(by_id) if host_ids is None else list(host_ids)
        for host_id in wanted:
            if host_id not in by_id:
                raise NotKnown(f"host {host_id!r}: not in the fleet ({', '.join(by_id)})")
        return [by_id[host_id] for host_id in wanted]
