"""The mission's values as the API shows them."""

import math
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from hsop_gcs.api.bounds import Account
from hsop_gcs.api.schemas import (
    AimOut,
    ClientsHealth,
    DetectionCounts,
    EventOut,
    FailsafesOut,
    HealthOut,
    HostLinkOut,
    HostOut,
    HoverOut,
    JournalHealth,
    LinkHealth,
    OrderOut,
    PendingOut,
    PlanningHealth,
    PlanOut,
    PlansOut,
    PositionOut,
    ReportCounts,
    SourceCounts,
    SourceIdOut,
    ThreatOut,
    TlogHealth,
    ViewOut,
)
from hsop_gcs.assignment import HostOrder
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.fleet import Host
from hsop_gcs.geometry.frames import Aim, GeodeticPoint
from hsop_gcs.journal import Journal
from hsop_gcs.link.protocol.gimbal import separation_deg
from hsop_gcs.link.pump import Link
from hsop_gcs.link.tlog import TlogWriter
from hsop_gcs.link.vehicle import Progress
from hsop_gcs.mission.controller import LoggedEvent, Mission
from hsop_gcs.mission.dispatch import OrderProgress
from hsop_gcs.mission.gates import Aircraft, Closed
from hsop_gcs.mission.state import Plan
from hsop_gcs.placement.scenario import plan_to_json
from hsop_gcs.tracks import Track

_HEARD_S = 30.0
"""A source that has said nothing for so long is no problem of now."""
_MOST_CLOCK_PROBLEMS = 9


def threat_out(track: Track, mission: Mission) -> ThreatOut:
    return ThreatOut(
        id=track.id,
        source=track.source,
        source_threat_id=track.source_threat_id,
        sources=[SourceIdOut(source=each.source, threat_id=each.threat_id) for each in track.sources],
        status=track.status,
        time=mission.utc(track.time_s),
        position=_position(mission.site.frame.to_geodetic(np.array(track.position_m))),
        position_enu_m=track.position_m,
        velocity_enu_mps=track.velocity_mps,
        velocity_known=track.velocity_known,
        covariance_enu=track.covariance.tolist(),
        size_m=track.size_m,
        sigma_m=track.sigma_m,
        reports=track.reports,
    )


def hosts_out(mission: Mission) -> list[HostOut]:
    unavailable, aircraft = mission.unavailable(), mission.sky.aircraft()
    return [_host(host, mission, aircraft[host.id], unavailable.get(host.id)) for host in mission.fleet.hosts]


def _host(host: Host, mission: Mission, aircraft: Aircraft, closed: Closed | None) -> HostOut:
    state = mission.vehicle(host).state
    local = None if state.position is None else mission.site.frame.to_enu(state.position).tolist()
    progress = mission.state.progress.get(host.id)
    return HostOut(
        id=host.id,
        system_id=host.system_id,
        remote_id=list(host.remote_id),
        reported=mission.own_reports[host.id],
        available=closed is None,
        unavailable_reason=None if closed is None else closed.reason,
        link_up=state.link_up,
        heard_s_ago=None if state.last_heard_s is None else mission.link.now() - state.last_heard_s,
        link=HostLinkOut.model_validate(mission.link.vehicle_link(host.system_id), from_attributes=True),
        autopilot=state.autopilot,
        vehicle_type=state.vehicle_type,
        component=state.component,
        firmware=state.firmware,
        armed=state.armed,
        in_air=state.in_air,
        mode=state.mode,
        position=None if state.position is None else _position(state.position),
        position_enu_m=local,
        heading_deg=state.heading_deg,
        gimbal=_aim(state.gimbal),
        battery_percent=state.battery_percent,
        last_text=state.texts[-1].text if state.texts else None,
        order=None if progress is None else _order(host, progress, mission),
        failsafes=FailsafesOut(
            checked=mission.vehicle(host).failsafes_checked, problems=list(mission.vehicle(host).failsafe_problems)
        ),
        take_off=mission.vehicle(host).take_off_status,
        pending=_pending(host, mission, aircraft, closed),
    )


def _pending(host: Host, mission: Mission, aircraft: Aircraft, closed: Closed | None) -> PendingOut | None:
    pending = mission.state.pending.get(host.id)
    if pending is None:
        return None
    return PendingOut(
        command=pending.wish,
        since=mission.utc(pending.since_s),
        by_operator=pending.by_operator,
        why="ordered, not confirmed yet" if closed is None or aircraft.flies_for_us else closed.reason,
    )


def event_out(logged: LoggedEvent, mission: Mission) -> EventOut:
    details = {name: value for name, value in asdict(logged.event).items() if name not in ("system", "host", "time_s")}
    return EventOut(
        number=logged.number,
        time=mission.utc(logged.time_s),
        host=logged.host,
        kind=type(logged.event).__name__,
        details=details,
    )


def plans_out(mission: Mission) -> PlansOut:
    state = mission.state.plans
    return PlansOut(
        autonomy=mission.state.autonomy,
        proposed=_plan(state.proposed, mission),
        flying=_plan(state.flying, mission),
        failed=_plan(state.failed, mission),
        awaited=mission.awaited,
    )


def health_out(mission: Mission, started_at_s: float, account: Account) -> HealthOut:
    """Return what works and what does not. started_at_s: when the service began, on the mission's clock."""
    unavailable = mission.unavailable()
    problems = _problems(mission, unavailable)
    newest = mission.state.plans.newest
    return HealthOut(
        status="degraded" if problems else "ok",
        problems=problems,
        notes=_notes(mission),
        time=mission.utc(mission.clock()),
        uptime_s=mission.clock() - started_at_s,
        autonomy=mission.state.autonomy,
        threats=len(mission.state.picture.tracks),
        hosts=len(mission.fleet.hosts),
        hosts_available=len(mission.fleet.hosts) - len(unavailable),
        reports=_reports(mission),
        detections=DetectionCounts.model_validate(mission.state.watch.counts, from_attributes=True),
        planning=PlanningHealth(
            ready=mission.planner_ready,
            restarts=mission.planner_restarts,
            plans_made=mission.state.plans.made,
            last_solve_s=None if newest is None else newest.decision.placement.solve_time_s,
            fault=mission.solver_fault,
        ),
        journal=None if mission.storage.journal is None else _journal(mission.storage.journal),
        tlog=None if mission.storage.tlog is None else _tlog(mission.storage.tlog),
        faults=dict(mission.fault_counts),
        gates=dict(mission.sky.closings),
        link=_link(mission.link),
        clients=ClientsHealth(
            connections=account.connections,
            refused={str(excess): count for excess, count in account.excesses.items()},
        ),
    )


def _problems(mission: Mission, unavailable: Mapping[str, Closed]) -> list[str]:
    """What does not work now, for a person."""
    problems = [f"host {host_id}: {closed.reason}" for host_id, closed in unavailable.items()]
    problems += _clock_problems(mission)
    problems += mission.refusals.problems(mission.clock())
    problems += mission.threatened.problems(mission.clock())
    if not mission.link.running:
        problems.append("link: the pump has stopped")
    problems += [f"link: {problem}" for problem in mission.link.problems]
    problems += [f"mission: a fault in {part}: {fault}" for part, fault in mission.faults.items()]
    problems += [f"host {host}: its poses are not kept: {fault}" for host, fault in mission.pose_faults.items()]
    for host in mission.fleet.hosts:
        link = mission.link.vehicle_link(host.system_id)
        if link.claimants:
            problems.append(f"host {host.id}: refused at {', '.join(link.claimants)}, where it is not registered")
        problems += [f"host {host.id}: {problem}" for problem in mission.vehicle(host).failsafe_problems]
        if link.hears_others and not mission.vehicle(host).state.link_up:
            heard = ", ".join(f"{count} of its {what}" for what, count in link.not_taken.items())
            problems.append(f"host {host.id}: no autopilot's heartbeat is heard, but other frames are: {heard}")
        if link.other_autopilots:
            others = ", ".join(str(component) for component in link.other_autopilots)
            problems.append(f"host {host.id}: a second autopilot speaks under its system id, as component {others}")
        if link.signature_refused and not mission.vehicle(host).state.link_up:
            refused = ", ".join(f"{count} {what}" for what, count in link.signature_refused.items())
            problems.append(f"host {host.id}: frames refused by signature: {refused}")
    problems += mission.storage.problems
    problems += [f"awaited: {reason}" for reason in mission.awaited.values()]
    if mission.solver_fault is not None:
        problems.append(f"planning: {mission.solver_fault}")
    if mission.state.plans.failed is not None:
        problems.append(f"no plan: {mission.state.plans.failed.decision.reason}")
    newest = mission.state.plans.newest
    if newest is not None:
        problems += [f"left out of plan {newest.id}: {why}" for why in newest.decision.left_out.values()]
    return problems


def _notes(mission: Mission) -> list[str]:
    """What works and could be safer, for a person."""
    trusting = [
        host.id for host in mission.fleet.hosts if mission.link.vehicle_link(host.system_id).trust == "spoke first"
    ]
    if not trusting:
        return []
    return [f"hosts {', '.join(trusting)}: neither signed nor pinned to an address: whoever speaks first is believed"]


def _clock_problems(mission: Mission) -> list[str]:
    timeline, now_s = mission.state.timeline, mission.clock()
    stepped = timeline.problem(now_s)
    problems = [] if stepped is None else [stepped]
    for name, offset_s in mission.dating.elsewhere.items():
        watch, by_s = mission.state.picture.sources.get(name), offset_s - timeline.offset_s
        if watch is not None and now_s - watch.last_heard_s <= _HEARD_S:
            side = "ahead of" if by_s > 0 else "behind"
            problems.append(f"source {name!r}: its clock is {abs(by_s):.1f} s {side} the system clock that was set")
    return problems[:_MOST_CLOCK_PROBLEMS]


def _journal(journal: Journal) -> JournalHealth:
    return JournalHealth(file=str(journal.path), bytes_cut=journal.bytes_cut, **asdict(journal.status))


def _tlog(tlog: TlogWriter) -> TlogHealth:
    return TlogHealth(fault=tlog.fault, lost=tlog.lost)


def _reports(mission: Mission) -> ReportCounts:
    ours_s = mission.state.timeline.offset_s
    return ReportCounts(
        accepted=mission.reports_accepted,
        refused_by_field=dict(mission.reports_refused),
        sources={
            name: SourceCounts(
                accepted=watch.accepted,
                out_of_order=watch.out_of_order,
                refused={str(kind): count for kind, count in watch.refused.items()},
                clock_offset_s=watch.clock_offset_s + mission.dating.elsewhere.get(name, ours_s) - ours_s,
                clock_samples=watch.clock_samples,
                last_heard=mission.utc(watch.last_heard_s),
            )
            for name, watch in mission.state.picture.sources.items()
        },
    )


def _link(link: Link) -> LinkHealth:
    return LinkHealth(
        **asdict(link.counters),
        dropped_datagrams=link.dropped_datagrams,
        superseded=link.superseded,
        lag_s=link.lag_s,
        send_errors=link.send_errors,
        strangers=[f"{each.system}/{each.component} at {each.peer.address}" for each in link.strangers],
    )


def _plan(plan: Plan | None, mission: Mission) -> PlanOut | None:
    if plan is None:
        return None
    decision = plan.decision
    return PlanOut(
        id=plan.id,
        made_at=mission.utc(plan.made_at_s),
        window_start=mission.utc(decision.window_start_s),
        expires_at=mission.utc(plan.expires_at_s),
        trigger=plan.trigger,
        reason=decision.reason,
        left_out=dict(decision.left_out),
        orders=[_hover(order, mission) for order in decision.orders],
        placement=plan_to_json(decision.placement),
    )


def _hover(order: HostOrder, mission: Mission) -> HoverOut:
    return HoverOut(
        host=order.host,
        position=_position(mission.site.frame.to_geodetic(np.array(order.position_m))),
        position_enu_m=order.position_m,
        heading_deg=order.heading_deg,
        aim=_aim(order.aim),
        views=_views(order.views),
        more_views=_views(order.more_views),
    )


def _order(host: Host, progress: OrderProgress, mission: Mission) -> OrderOut:
    errors = mission.vehicle(host).progress
    if errors is not None and not (progress.on_last_leg and errors.order.order_id == progress.leg_id):
        errors = None
    return OrderOut(
        order_id=progress.order_id,
        plan_id=progress.plan_id,
        status=progress.status,
        note=mission.why_waiting(host) or progress.note,
        position=_position(mission.site.frame.to_geodetic(np.array(progress.order.position_m))),
        heading_deg=progress.order.heading_deg,
        aim=_aim(progress.order.aim),
        views=_views(progress.order.views),
        more_views=_views(progress.order.more_views),
        hover_error_m=None if errors is None else _distance(errors.horizontal_error_m, errors.vertical_error_m),
        heading_error_deg=None if errors is None else errors.heading_error_deg,
        gimbal_error_deg=_gimbal_error_deg(host, mission, errors),
    )


def _gimbal_error_deg(host: Host, mission: Mission, errors: Progress | None) -> float | None:
    """Against where the threats are now once the host follows them, against the order before."""
    looks, target = mission.vehicle(host).state.gimbal, mission.sky.target_of(mission.state, host, mission.clock())
    if looks is not None and target is not None:
        return separation_deg(looks, target)
    return None if errors is None or errors.order.aim is None else errors.gimbal_error_deg


def _distance(horizontal_m: float | None, vertical_m: float | None) -> float | None:
    return None if horizontal_m is None or vertical_m is None else math.hypot(horizontal_m, vertical_m)


def _position(point: GeodeticPoint) -> PositionOut:
    return PositionOut(lat_deg=point.lat_deg, lon_deg=point.lon_deg, altitude_amsl_m=point.altitude_amsl_m)


def _aim(aim: Aim | None) -> AimOut | None:
    return None if aim is None else AimOut(pan_deg=aim.pan_deg, tilt_deg=aim.tilt_deg)


def _views(views: tuple[tuple[str, CameraKind], ...]) -> list[ViewOut]:
    return [ViewOut(threat=threat, camera=camera) for threat, camera in views]
