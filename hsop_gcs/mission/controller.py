"""The mission's shell: gives inputs to the core as time, consoles, the link and the solver bring them, and acts.

What is decided is decided by pure functions (``core``, ``pipeline``, ``state``, ``dispatch``, ``tracks``); here they
meet the clock, the journal, the link and the solver's process. An input is given to the journal before it is applied,
and an order after that; a journal that cannot be written keeps it in memory, and stops nothing.
"""

import asyncio
import contextlib
import logging
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from itertools import islice

from hsop_gcs.detections import Detection, Fate, Ray, let_go, rays_of
from hsop_gcs.detections import Verdict as RayVerdict
from hsop_gcs.disk import DiskWatch
from hsop_gcs.errors import NotKnown, Refused, Unavailable
from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.journal import Journal
from hsop_gcs.link.events import Event, OrderFailed
from hsop_gcs.link.faults import describe
from hsop_gcs.link.pump import Link
from hsop_gcs.link.tlog import TlogWriter
from hsop_gcs.link.vehicle import Vehicle
from hsop_gcs.mission.clock import MissionClock
from hsop_gcs.mission.commander import Commander
from hsop_gcs.mission.core import MissionState, Wish, apply, situation, take_rays, take_reports
from hsop_gcs.mission.dating import Dating
from hsop_gcs.mission.departures import check_take_off, departures
from hsop_gcs.mission.dispatch import OrderStatus
from hsop_gcs.mission.gates import UNHEARD, Closed
from hsop_gcs.mission.inputs import (
    ClockStepped,
    DecisionMade,
    HostDeparted,
    HostGaveWay,
    HostSetAside,
    HostsHeld,
    HostSpoke,
    HostsRecalled,
    HostsReleased,
    HostStopped,
    HostThreatened,
    Input,
    LegFlown,
    MissionStarted,
    PlanFlew,
    ProposalRefused,
    RaysArrived,
    ReportsArrived,
    Rules,
    SolverAsked,
    ThreatDismissed,
    TimePassed,
    WishLapsed,
)
from hsop_gcs.mission.notices import Notice, ServiceBehind, ServiceCaughtUp
from hsop_gcs.mission.planning import Situation
from hsop_gcs.mission.poses import Poses
from hsop_gcs.mission.refusals import Refusals
from hsop_gcs.mission.sky import Sky
from hsop_gcs.mission.solver import Solver
from hsop_gcs.mission.state import Autonomy, Plan, ready, replan_reason
from hsop_gcs.mission.storage import Storage
from hsop_gcs.mission.threatened import Threatened
from hsop_gcs.mission.traffic import SUPERVISION, Blocked, Faulty, Move, Traffic
from hsop_gcs.reports import Measurement, Site
from hsop_gcs.tracks import Refusal, RefusalKind, Verdict, prune

_TICK_S = 0.2
_REST_S = 0.02
"""After each look at everything: what comes meanwhile, such as hundreds of reports a second, is looked at together."""
_GIMBAL_LAG_S = 0.2
"""From working out an aim to a gimbal that looks there: half a tick, the link and the gimbal's own response."""
_EVENTS_KEPT = 500
_GONE_TOLD = 10
"""Threats that leave at the same time and are logged by name."""
_BEHIND = "the service is behind its link: what it knows of the sky is old"
_HOSTS_AWAITED_S = 5.0
"""After a restart, how long the first question to the planner waits for hosts that had orders."""
_OVERDUE_S = 5.0
"""How long after its time limit a planner's answer is late, and told: no plans are made then."""
_TRACKER_LOADS = "the tracker's kernels are being loaded, the first time on a machine compiled"
_NO_FAULT = frozenset({RefusalKind.OWN_HOST, RefusalKind.DUPLICATE, RefusalKind.DISMISSED})
"""Refusals that say nothing against their source."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedEvent:
    """What happened to a host, for people; numbers rise by one."""

    number: int
    time_s: float
    """Mission time."""
    host: str | None
    """None: it happened to the mission."""
    event: Event | Input | Notice


class Mission:
    """One mission from its first report to its last order. ``clock``: of the recovered mission, if it goes on."""

    def __init__(
        self,
        *,
        fleet: Fleet,
        site: Site,
        link: Link,
        solver: Solver,
        clock: MissionClock,
        rules: Rules | None = None,
        recovered: MissionState | None = None,
        journal: Journal | None = None,
        tlog: TlogWriter | None = None,
        disk: DiskWatch | None = None,
        tracker_ready: bool = True,
    ) -> None:
        """tracker_ready: see the attribute. recovered: how an earlier service left the mission, by the journal."""
        self.fleet = fleet
        self.site = site
        self.link = link
        self.clock = clock
        """Mission time; see ``utc``."""
        self.state = recovered or MissionState()
        self.events: deque[LoggedEvent] = deque(maxlen=_EVENTS_KEPT)
        self.reports_accepted = 0
        self.reports_refused: Counter[str] = Counter()
        """Refused reports by the field that was at fault."""
        self.own_reports: Counter[str] = Counter()
        """Reports that were taken for an aircraft of ours, by host."""
        self.dating = Dating()
        self.refusals = Refusals()
        self.solver_fault: str | None = None
        """What went wrong in the solver's process, if its last run did not end in an answer."""
        self.faults: dict[str, str] = {}
        """What the mission fails at now, and how; without the supervision of flights our heartbeat is withheld."""
        self.fault_counts: Counter[str] = Counter()
        """How often the mission failed at what, since the service started."""
        self._longest_lag_s = 0.0
        """By how much the link was late at worst since the service is behind it; 0: it is not."""
        self.storage = Storage(journal, tlog, disk)
        self.tracker_ready = tracker_ready
        """Whether the tracker's kernels are loaded: before that reports are refused, they would stop the loop."""
        self.sky = Sky(fleet, site, link)
        self._solver = solver
        self._solving: asyncio.Task[None] | None = None
        self._asked_s: float | None = None
        """When the planner was asked what it has not answered yet."""
        self._changed = asyncio.Event()
        self._blocked: dict[str, Blocked] = {}
        """Why hosts that wait did not depart when that was last looked at."""
        self.threatened = Threatened()
        self._poses = Poses(fleet, site.frame, link, clock)
        self._commander = Commander(fleet, site.frame, link)
        self._awaits_hosts_until_s = link.now() + _HOSTS_AWAITED_S
        self._awaited_hosts = frozenset() if recovered is None else frozenset(recovered.progress)
        names = tuple(host.id for host in fleet.hosts)
        started = MissionStarted(
            time_s=clock(), rules=rules or Rules(), hosts=names, steady_s=clock.steady_s, boot=clock.boot
        )
        self._take(started)
        self._keep_time()

    # What is awaited

    @property
    def awaited(self) -> dict[str, str]:
        """What the first question to the planner waits for, each with the reason for a person; empty: nothing."""
        found = {}
        if not self.tracker_ready:
            found["kernels"] = f"{_TRACKER_LOADS}; reports are refused"
        if not self._solver.ready:
            found["planner"] = "the planner's process is starting, the first time on a machine it compiles its kernels"
        elif (overdue := self._overdue()) is not None:
            found["planner"] = overdue
        unheard = self._unheard()
        if unheard:
            found["links"] = f"after the restart no telemetry yet of {', '.join(unheard)}"
        return found

    def _overdue(self) -> str | None:
        """Why no plans are made although the planner lives: it hangs, is stopped, or starves."""
        limit_s = self.state.rules.planning.time_limit_s
        waited_s = 0.0 if self._asked_s is None else self.clock() - self._asked_s
        if waited_s < limit_s + _OVERDUE_S:
            return None
        return f"the planner has not answered for {waited_s:.0f} s; planning.time_limit_s is {limit_s:g}"

    def _unheard(self) -> list[str]:
        """The hosts that had orders before a restart and have not been heard well enough since to be sent.

        They are awaited for a few seconds: a plan without them would be made again as soon as they are heard.
        """
        if not self._awaited_hosts or self.link.now() >= self._awaits_hosts_until_s:
            return []
        return [host for host, at in self.unavailable().items() if host in self._awaited_hosts and at.gate in UNHEARD]

    def _check_tracker(self) -> None:
        if not self.tracker_ready:
            raise Unavailable(f"{_TRACKER_LOADS}; report again in a few seconds")

    # What consoles ask for

    def submit(self, measurements: Sequence[Measurement]) -> tuple[Verdict, ...]:
        """Take measurements that arrived together, dated in UTC by their sources, into the picture.

        Return what became of each, in their order. Raises Unavailable while the tracker's kernels are loaded.
        """
        self._check_tracker()
        now_s = self._keep_time()
        dated = self.dating.reports(measurements, now_s, self.state)
        own = self._poses.paths.beside(dated, now_s, self.state.rules.tracks)
        given = ReportsArrived(time_s=now_s, measurements=dated, own=own)
        after, verdicts = take_reports(self.state, given)
        self.storage.record(given)
        self.state = after
        for each, verdict in zip(dated, verdicts, strict=True):
            if not isinstance(verdict, Refusal):
                self.reports_accepted += 1
                self.refusals.accepted(each.source)
            elif verdict.kind in _NO_FAULT:
                self.refuse_report(verdict.field)
                if verdict.host is not None:
                    self.own_reports[verdict.host] += 1
            else:
                self.refuse_report(verdict.field, verdict.problem, source=each.source)
        self._changed.set()
        return verdicts

    def detect(self, detections: Sequence[Detection]) -> tuple[RayVerdict, ...]:
        """Take what hosts' cameras saw, dated in UTC, into the picture.

        Return what became of each detection, in their order. Raises Unavailable while the tracker's kernels are loaded.
        """
        self._check_tracker()
        rules, now_s = self.state.rules, self._keep_time()
        dated = self.dating.detections(detections, now_s, self.state)
        rays = rays_of(dated, self._poses.histories, self.fleet.rigs(), rules.detections)
        seen_s = min((each.time_s for each in rays if isinstance(each, Ray)), default=now_s)
        given = RaysArrived(time_s=now_s, rays=rays, own=self._poses.paths.all_since(seen_s, now_s))
        after, verdicts = take_rays(self.state, given)
        self.storage.record(given)
        self.state = after
        for each, verdict in zip(dated, verdicts, strict=True):
            if verdict.fate is not Fate.REFUSED:
                self.refusals.accepted(f"cameras of {each.host}")
            elif verdict.refusal is not None and verdict.refusal.reason not in _NO_FAULT:
                self.refusals.refused(f"cameras of {each.host}", verdict.refusal.problem, now_s)
        self._changed.set()
        return verdicts

    def refuse_report(self, field: str, problem: str = "", *, source: str | None = None) -> None:
        """Count a report that was refused, here or before it got here. source: whose fault it is, if it is known."""
        self.reports_refused[field] += 1
        if source is not None:
            self.refusals.refused(source, f"{field}: {problem}", self.clock())

    def utc(self, time_s: float) -> datetime:
        """Return mission time as the system clock has it now."""
        return datetime.fromtimestamp(time_s + self.state.timeline.offset_s, UTC)

    def dismiss(self, threat_id: str) -> None:
        """Take a threat out of the picture; its sources' reports of it are refused for a while."""
        if threat_id not in self.state.picture.tracks:
            raise NotKnown(f"threat {threat_id!r}: not in the picture")
        self._take(ThreatDismissed(time_s=self.clock(), threat_id=threat_id))
        self._changed.set()

    def approve(self, plan_id: str) -> Plan:
        """Let the proposed plan fly. Raises NotKnown, or Refused if it is not the proposal any more or not safe now:
        then another one is made; Unavailable while a restart would not know of its flights.
        """
        self.link.require_running()
        plans = self.state.plans
        plan = plans.proposed
        known = {each.id for each in (plan, plans.flying, plans.failed) if each is not None}
        if plan is None or plan.id != plan_id:
            if plan_id in known:
                raise Refused(f"plan {plan_id} is not waiting for approval")
            raise NotKnown(f"plan {plan_id!r}: there is no such plan" + (f"; {plan.id} is proposed" if plan else ""))
        if self.state.autonomy is Autonomy.ADVISE:
            raise Refused("this service only advises: plans are not flown")
        self._check_storage()
        self._fly(plan)
        return plan

    def take_off(self, altitude_m: float, host_ids: Iterable[str] | None = None) -> list[str]:
        """Order hosts into the air, ``altitude_m`` above their homes; return their ids. Only an operator does this.

        Raises Refused, and nobody takes off, if one of them does not pass a gate; Unavailable while a restart would not
        know of it.
        """
        self.link.require_running()
        hosts = self._hosts(host_ids)
        self._check_storage()
        check_take_off(hosts, altitude_m, self.state, self.sky, self.clock())
        names = tuple(host.id for host in hosts)
        for host in hosts:
            self.link.take_off(host.system_id, altitude_m)
        kept_back = {*self.state.aside, *self.state.pending, *self.state.held_hosts}
        if kept_back.intersection(names):
            self._take(HostsReleased(time_s=self.clock(), hosts=names, everyone=False))
        return list(names)

    def _check_storage(self) -> None:
        if (reason := self.storage.why_nothing_new) is not None:
            raise Unavailable(reason)

    def hold(self, host_ids: Iterable[str] | None = None) -> list[str]:
        """Stop hosts where they are; return their ids. From then on no plan flies without a person's approval."""
        self.link.require_running()
        hosts = self._hosts(host_ids)
        self._commander.tell(hosts, Wish.HOLD)
        self._take(HostsHeld(time_s=self.clock(), hosts=tuple(host.id for host in hosts)))
        return [host.id for host in hosts]

    def recall(self, host_ids: Iterable[str] | None = None) -> list[str]:
        """Send hosts home; return their ids. They are planned without until released; nothing flies unapproved."""
        self.link.require_running()
        hosts = self._hosts(host_ids)
        self._commander.tell(hosts, Wish.RECALL)
        self._take(HostsRecalled(time_s=self.clock(), hosts=tuple(host.id for host in hosts)))
        return [host.id for host in hosts]

    def on_the_ground(self, host_ids: Iterable[str]) -> list[str]:
        """Return those of the hosts that are heard and stand on the ground: a recall has nothing to send to them."""
        return [host.id for host in self._hosts(host_ids) if self._commander.on_the_ground(host)]

    def release(self, host_ids: Iterable[str] | None = None) -> list[str]:
        """Give hosts back to the mission; return their ids. All of them: plans fly by its own autonomy again."""
        self.link.require_running()
        hosts = tuple(host.id for host in self._hosts(host_ids))
        self._take(HostsReleased(time_s=self.clock(), hosts=hosts, everyone=host_ids is None))
        self._changed.set()
        return list(hosts)

    def register(self, host_id: str, address: str) -> None:
        """Listen to a host at another address from now on. Raises NotKnown; BadInput for one that was not heard."""
        (host,) = self._hosts([host_id])
        self.link.register(host.system_id, address)

    @property
    def pose_faults(self) -> Mapping[str, str]:
        """Hosts whose telemetry makes no pose now, and why."""
        return self._poses.faults

    @property
    def planner_ready(self) -> bool:
        return self._solver.ready

    @property
    def planner_restarts(self) -> int:
        return self._solver.restarts

    def vehicle(self, host: Host) -> Vehicle:
        """Return the host's end of the link: its telemetry and how its order stands."""
        return self.link.vehicles[host.system_id]

    def unavailable(self) -> dict[str, Closed]:
        """Return the gate at which each host that cannot be sent stands, and why."""
        return self.sky.closed(self.state, self.clock())

    def why_waiting(self, host: Host) -> str | None:
        """Return what a host whose order waits is waiting for; None if it does not wait."""
        blocked = self._waits_for(host.id)
        return None if blocked is None else blocked.reason

    def _waits_for(self, host: str) -> Blocked | None:
        progress, blocked = self.state.progress.get(host), self._blocked.get(host)
        if progress is None or blocked is None or progress.status is not OrderStatus.WAITING:
            return None
        return blocked if blocked.order_id == progress.order_id else None

    # What time brings

    async def run(self) -> None:
        """Move the mission on until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._watch_link())
            tasks.create_task(self._poses.watch())
            while True:
                self._round(tasks)
                self._changed.clear()
                await asyncio.sleep(_REST_S)
                # not wait_for: of a timeout and a cancellation at once it keeps the timeout (before Python 3.12)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_TICK_S - _REST_S):
                        await self._changed.wait()

    def _round(self, tasks: asyncio.TaskGroup) -> None:
        """Do what is due, each part whatever becomes of the others.

        Our heartbeat stands for the supervision of flights, and for nothing else: it stops when that fails.
        """
        self._attempt("telling that the clock was set", self._keep_time)
        now_s = self.clock()
        self._attempt("the care for the disk", lambda: self._tend_storage(now_s))
        if self.tracker_ready:
            self._attempt("the age of tracks", lambda: self._age(now_s))
        self._attempt("telling that the link is behind", self._watch_lag)
        if not self.link.behind:
            self._attempt("flying a plan unasked", self._fly_unasked)
        if self._attempt("the supervision of flights", lambda: self._direct_traffic(now_s)):
            self.link.keep_alive()
        self._attempt("the cameras' aims", lambda: self._follow_threats(now_s))
        self._attempt("asking for a plan", lambda: self._plan_if_due(tasks))

    def _attempt(self, part: str, act: Callable[[], object]) -> bool:
        """Do a part of what is due; return whether it was done. What it fails at is told, and tried again."""
        try:
            act()
        except Exception as error:
            self._note_fault(part, error)
            return False
        self.faults.pop(part, None)
        return True

    def _note_fault(self, part: str, error: Exception) -> None:
        self.fault_counts[part] += 1
        if part not in self.faults:
            log.error("%s failed", part, exc_info=error)
        self.faults[part] = describe(error)

    def _tend_storage(self, now_s: float) -> None:
        for notice in self.storage.tend(self.state, now_s):
            self._log(None, notice)

    def _plan_if_due(self, tasks: asyncio.TaskGroup) -> None:
        now_s = self.clock()
        if self._solving is None and not self.awaited:
            tracks = ready(self.state.picture.tracks.values(), now_s, self.state.rules.replanning)
            unavailable = self.unavailable()
            self.sky.note(unavailable)
            movers = self.sky.movers(unavailable)
            rules = self.state.rules
            waiting = [host for host, each in self.state.progress.items() if each.status is OrderStatus.WAITING]
            barred = [host for host in waiting if (each := self._waits_for(host)) is not None and each.for_good]
            reason = replan_reason(
                self.state.plans,
                tracks,
                movers,
                now_s,
                rules.replanning,
                rules.planning,
                waiting,
                barred,
                self.state.ways_given,
            )
            if reason is not None:
                standing = self.sky.standing(self.state, unavailable)
                given = situation(self.state, movers, now_s, standing=standing)
                asked = SolverAsked(time_s=now_s, trigger=reason, situation=given)
                self._take(asked)
                self._asked_s = now_s
                self._solving = tasks.create_task(self._solve(asked.situation))

    def _keep_time(self) -> float:
        """Return mission time; a system clock that has been set meanwhile is told."""
        now_s = self.clock()
        by_s = self.clock.offset_s - self.state.timeline.offset_s
        if by_s != 0.0:
            stepped = ClockStepped(time_s=now_s, by_s=by_s, offset_s=self.clock.offset_s)
            self._take(stepped)
            self._log(None, stepped)
            log.warning("the system clock was set by %+.1f s; the mission's time goes on", by_s)
        return now_s

    def _watch_lag(self) -> None:
        """Tell once that the service is behind its link, and once that it has caught up."""
        if self.link.behind:
            if self._longest_lag_s == 0.0:
                self._log(None, ServiceBehind(lag_s=self.link.lag_s))
                log.warning("the service is %.1f s behind its link", self.link.lag_s)
            self._longest_lag_s = max(self._longest_lag_s, self.link.lag_s)
        elif self._longest_lag_s > 0.0:
            self._log(None, ServiceCaughtUp(longest_s=self._longest_lag_s))
            self._longest_lag_s = 0.0

    def _age(self, now_s: float) -> None:
        after, gone = prune(self.state.picture, now_s, self.state.rules.tracks)
        for threat_id, last_s in islice(gone.items(), _GONE_TOLD):
            log.info("threat %s has not been reported for %.0f s: it has left", threat_id, now_s - last_s)
        if len(gone) > _GONE_TOLD:
            log.info("%d more threats have left", len(gone) - _GONE_TOLD)
        changed = after.tracks is not self.state.picture.tracks
        if changed or let_go(self.state.watch, now_s, self.state.rules.detections) is not self.state.watch:
            self._take(TimePassed(time_s=now_s))

    def _follow_threats(self, now_s: float) -> None:
        """Keep central cameras on their threats, on the way and between plans."""
        for host in self.fleet.hosts:
            aim = self.sky.target_of(self.state, host, now_s + _GIMBAL_LAG_S)
            if aim is not None:
                self.link.follow(host.system_id, aim)

    async def _solve(self, asked: Situation) -> None:
        try:
            decision = await self._solver.decide(asked, self.state.rules.planning)
            self.solver_fault = None
            self._take(DecisionMade(time_s=self.clock(), decision=decision))
        except Exception as error:  # whatever the solver does, the service goes on and says so
            self.solver_fault = f"{type(error).__name__}: {error}"
            known = isinstance(error, BrokenProcessPool | TimeoutError)  # where they were raised says nothing
            log.error("the solver failed: %s", self.solver_fault, exc_info=None if known else error)
            self._asked_s = None
            await asyncio.sleep(self.state.rules.replanning.retry_s)
        finally:
            self._solving = self._asked_s = None
            self._changed.set()

    def _fly(self, plan: Plan) -> None:
        """Let the proposed plan's hosts depart. If none can, the proposal is over: raises Refused."""
        now_s = self.clock()
        try:
            departing = departures(plan, self.state, self.sky, now_s)
        except Refused as error:
            self._take(ProposalRefused(time_s=now_s, reason=str(error)))
            self._changed.set()
            raise
        self._take(PlanFlew(time_s=now_s, plan_id=plan.id, departures=departing))
        self._direct_traffic(now_s)

    def _direct_traffic(self, now_s: float) -> None:
        """Let hosts depart, fly on, turn aside, stop and try again."""
        traffic = self.sky.traffic(self.state, now_s, self._blocked)
        failed = set()
        for given in list(traffic.moves()):
            if isinstance(given, HostDeparted) and self.link.behind and self._waits(given.host):
                order_id = self.state.progress[given.host].order_id
                given = Blocked(host=given.host, order_id=order_id, time_s=now_s, reason=_BEHIND)
            if isinstance(given, Faulty):
                failed.add(given.part)
                self._note_fault(given.part, given.error)
            elif isinstance(given, Blocked):
                self._blocked[given.host] = given
            elif not isinstance(given, HostThreatened) or self.threatened.is_news(given):
                self._move(given, traffic, now_s)
        for part in [part for part in self.faults if part.startswith(SUPERVISION) and part not in failed]:
            del self.faults[part]
        self._commander.insist(self.state.pending, self.sky.aircraft())

    def _waits(self, host: str) -> bool:
        return self.state.progress[host].status is OrderStatus.WAITING

    def _move(self, given: Move, traffic: Traffic, now_s: float) -> None:
        """Write down what traffic decided of a host, and do it."""
        host = self._hosts([given.host])[0]
        if isinstance(given, HostStopped):
            self._stop(host)
            self.sky.closings[given.gate] += given.host not in traffic.closed
        elif isinstance(given, WishLapsed) or (isinstance(given, HostSetAside) and given.until_s is None):
            self.link.leave_alone(host.system_id)
        self._take(given)
        self._log(host, given)
        if isinstance(given, HostGaveWay):
            self.sky.closings["gave way"] += 1
            way, aim = self.state.ways_given[host.id], self.sky.target_of(self.state, host, now_s)
            heading_deg = self.sky.heading_deg(self.state, host)
            self._commander.give_way(host, way, heading_deg=heading_deg, aim=aim)
        if isinstance(given, HostDeparted | LegFlown):
            plan = self.state.plans.flying
            assert plan is not None, "only hosts of the flying plan are sent"
            self._commander.send(self.state.progress[host.id], for_s=plan.expires_at_s - now_s)

    def _fly_unasked(self) -> None:
        """In auto, let a proposal fly."""
        proposed = self.state.plans.proposed
        if self.state.autonomy is not Autonomy.AUTO or proposed is None or self.storage.why_nothing_new is not None:
            return
        try:
            self._fly(proposed)
        except Refused as error:
            log.warning("plan %s does not fly: %s", proposed.id, error)

    async def _watch_link(self) -> None:
        while True:
            event = await self.link.events.get()
            # one event costs itself; what it told of is seen in the telemetry
            self._attempt(f"taking a {type(event).__name__}", partial(self._hear, event))
            self._changed.set()

    def _hear(self, event: Event) -> None:
        host = self.fleet.host_of_system(event.system)
        progress = self.state.progress.get(host.id)
        if isinstance(event, OrderFailed) and progress is not None and progress.leg_id == event.order_id:
            self._stop(host)
        self._log(host, event)
        self._take(HostSpoke(time_s=self.clock(), host=host.id, event=event))

    def _stop(self, host: Host) -> None:
        """Hold a host that may still fly to its point; one that somebody else flies is left to him."""
        if self.sky.aircraft()[host.id].flies_for_us:
            self._commander.tell([host], Wish.HOLD)

    def _log(self, host: Host | None, event: Event | Input | Notice) -> None:
        number = self.events[-1].number + 1 if self.events else 1
        name = None if host is None else host.id
        self.events.append(LoggedEvent(number=number, time_s=self.clock(), host=name, event=event))

    # How the state moves on

    def _take(self, given: Input) -> None:
        # what the mission cannot take does not get into its journal: a service that starts again could not read it
        after = apply(self.state, given)
        self.storage.record(given)
        self.state = after

    def _hosts(self, host_ids: Iterable[str] | None) -> list[Host]:
        by_id = {host.id: host for host in self.fleet.hosts}
        wanted = list(by_id) if host_ids is None else list(host_ids)
        for host_id in wanted:
            if host_id not in by_id:
                raise NotKnown(f"host {host_id!r}: not in the fleet ({', '.join(by_id)})")
        return [by_id[host_id] for host_id in wanted]
