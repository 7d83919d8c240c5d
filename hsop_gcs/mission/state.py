"""Plans and their life, as values: proposed → (approved) → flying → replaced, and when a new one is due.

        a decision            approve(id) or autonomy auto
(none) ────────────▶ proposed ────────────────────────────▶ flying
                        │ a newer decision, its window is      │ a newer plan flies, or
                        │ over, or it is not safe any more     │ all its threats are gone
                        ▼                                      ▼
                     replaced                                 over
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType

from hsop_gcs.assignment import Mover
from hsop_gcs.detections.merging import is_only_seen
from hsop_gcs.mission.dispatch import WayGiven
from hsop_gcs.mission.pipeline import why_over
from hsop_gcs.mission.planning import Decision, PlanningRules, Sigma, Situation
from hsop_gcs.placement.problem import Threat
from hsop_gcs.tracks import Track, TrackStatus

_LOOK_AHEAD_S = 5.0
"""So long from now on, or once its hosts can be there, a plan has to do what it is for: a new one takes as long to
carry out, and what is predicted for later will have changed by then."""
_TRUSTED_S = 3.0
"""So long after it is made a plan is held against where threats are, not where they will be: hosts must get going."""


class Autonomy(StrEnum):
    """Who decides that a plan flies."""

    ADVISE = "advise"
    """Nobody: plans are shown, never flown."""
    CONFIRM = "confirm"
    """A person approves each plan."""
    AUTO = "auto"
    """Every plan flies at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A decision with a name and a time; all times are seconds since the Unix epoch."""

    id: str
    made_at_s: float
    expires_at_s: float
    """End of its window: the prediction it was made for reaches no further."""
    trigger: str
    """Why it was made."""
    asked_at_s: float
    sigmas: Mapping[str, Sigma]
    """How sure the threats' states were when it was asked for."""
    decision: Decision


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanRules:
    """When a plan is due."""

    departure_m: float = 5.0
    """A threat this far from its prediction has departed from it, on top of what is uncertain now and, until it is
    known to this, of what was uncertain then. A plan that a threat has departed from is over if its hosts would come
    too near to a threat or not see it."""
    retry_s: float = 2.0
    """Between attempts while no plan can be made."""
    velocity_wait_s: float = 1.5
    """A threat without a known velocity is given this long to show one before it is planned for at rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plans:
    """The plans there are. ``failed`` is the newest decision that could not become a plan, None once one could."""

    proposed: Plan | None = None
    flying: Plan | None = None
    failed: Plan | None = None
    made: int = 0

    @property
    def newest(self) -> Plan | None:
        """The plan that the next one has to improve on."""
        plans = [plan for plan in (self.proposed, self.flying, self.failed) if plan is not None]
        return max(plans, key=lambda plan: plan.made_at_s, default=None)


def ready(tracks: Iterable[Track], now_s: float, rules: ReplanRules) -> tuple[Track, ...]:
    """Return the tracks worth planning for: confirmed, with a velocity that is known or will not be known soon.

    What nobody but our cameras has ever told of counts while they see it: rays that cross by chance start such tracks.
    """
    return tuple(
        track
        for track in tracks
        if track.status is not TrackStatus.TENTATIVE
        and not (is_only_seen(track) and track.status is TrackStatus.COASTING)
        and (track.velocity_known or now_s - track.first_seen_s > rules.velocity_wait_s)
    )


def replan_reason(
    plans: Plans,
    tracks: tuple[Track, ...],
    movers: tuple[Mover, ...],
    now_s: float,
    rules: ReplanRules,
    planning: PlanningRules,
    waiting: Iterable[str] = (),
    barred: Iterable[str] = (),
    ways_given: Mapping[str, WayGiven] = MappingProxyType({}),
) -> str | None:
    """Return why a new plan is due now, for a person, or None.

    movers: the hosts that can be sent. waiting: those that have not been able to depart, or not again. barred: those
    that will not be, for what is in their way stays there. ways_given: the hosts that gave way to a threat and are not
    on their way to a hover point since.
    """
    if not tracks:
        return None
    newest = plans.newest
    if newest is None:
        return f"threat {tracks[0].id} appeared"
    planned = {threat.id for threat in newest.decision.threats}
    if newest is plans.failed:
        # one that could not be flown any more was good a moment ago: the next one may be
        due_s = newest.made_at_s + (0.0 if newest.decision.orders else rules.retry_s)
        return "no plan yet" if now_s >= due_s else None
    for track in tracks:
        if track.id not in planned:
            return f"threat {track.id} appeared"
    for threat_id in planned:
        if threat_id not in {track.id for track in tracks}:
            return f"threat {threat_id} left"
    departed = next((why for track in tracks if (why := _departed(newest, track, now_s, rules)) is not None), None)
    if departed is not None and (over := _over(newest, tracks, movers, now_s, planning)) is not None:
        return f"{departed}: {over}"
    if newest.decision.left_out and now_s > newest.made_at_s + planning.horizon_s:
        return f"threat {next(iter(newest.decision.left_out))} was left out"
    available = {mover.id for mover in movers}
    for order in newest.decision.orders:
        if order.host not in available:
            return f"host {order.host} is not available any more"
    if newest is plans.flying and now_s > newest.made_at_s + rules.retry_s:
        for order in newest.decision.orders:
            way = ways_given.get(order.host)
            if way is not None and way.since_s > newest.asked_at_s:
                return f"host {order.host} gave way to threat {way.threat}"
    # a decision that keeps the plan changes nothing for a host that waits: the next one is not due at once
    if newest is plans.flying and now_s > newest.made_at_s + rules.retry_s:
        for host in barred:
            return f"host {host} cannot get to its hover point"
    if newest is plans.flying and now_s > max(newest.decision.window_start_s, newest.made_at_s + rules.retry_s):
        for host in waiting:
            return f"host {host} should be there and still waits to depart"
    if now_s > newest.expires_at_s:
        return "the horizon has run out"
    return None


def threat_of(track: Track, now_s: float) -> Threat:
    """Return the track as planning sees it: where it is now, at rest while its velocity is not known."""
    return Threat(
        id=track.id,
        position_m=track.position_at(now_s),
        velocity_mps=track.velocity_mps if track.velocity_known else (0.0, 0.0, 0.0),
        size_m=track.size_m,
    )


def _departed(plan: Plan, track: Track, now_s: float, rules: ReplanRules) -> str | None:
    """Say how far a threat is, or will be, from where the plan expects it; None if that is within what is uncertain."""
    planned = next(threat for threat in plan.decision.threats if threat.id == track.id)
    moments = [(now_s, "is")]
    if now_s > plan.made_at_s + _TRUSTED_S:
        moments += [(max(now_s, plan.decision.window_start_s), "will be"), (plan.expires_at_s, "will be")]
    before = plan.sigmas[track.id]
    now = replace(before, position_m=track.sigma_m, velocity_mps=track.velocity_sigma_mps)
    is_known = now.position_m < rules.departure_m
    for at_s, verb in moments:
        predicted_m = planned.predicted_m(at_s - plan.decision.window_start_s)
        departed_m = math.dist(predicted_m, track.position_at(at_s))
        doubt_m = now.after(at_s - track.time_s)
        if not is_known:
            doubt_m = math.hypot(doubt_m, before.after(at_s - plan.asked_at_s))
        if departed_m > rules.departure_m + 3 * doubt_m:
            return f"threat {track.id} {verb} {departed_m:.0f} m from its prediction"
    return None


def _over(
    plan: Plan, tracks: tuple[Track, ...], movers: tuple[Mover, ...], now_s: float, planning: PlanningRules
) -> str | None:
    """Say why the plan cannot do any more what it is for; None if it can, in spite of what has departed from it."""
    decision = plan.decision
    expected = {threat.id for threat in decision.threats if threat.id not in decision.left_out}
    if not {pair.threat for pair in decision.placement.pairs} >= expected:
        return "not all threats are seen"
    from_s = max(plan.decision.window_start_s - now_s, 0.0)
    threats = tuple(threat_of(track, now_s) for track in tracks)
    return why_over(plan.decision, threats, movers, planning, from_s=from_s, until_s=from_s + _LOOK_AHEAD_S)


def with_decision(
    plans: Plans, decision: Decision, *, asked: Situation, trigger: str, now_s: float, horizon_s: float
) -> Plans:
    """Return the plans after a decision: a new proposal, the flying plan for longer, or a failure to show."""
    made = plans.made + 1
    plan = Plan(
        id=f"P{made}",
        made_at_s=now_s,
        expires_at_s=decision.window_start_s + horizon_s,
        trigger=trigger,
        asked_at_s=asked.now_s,
        sigmas={threat.id: sigma for threat, sigma in zip(asked.threats, asked.sigmas, strict=True)},
        decision=decision,
    )
    if decision.keeps and plans.flying is not None:
        return replace(plans, flying=replace(plan, id=plans.flying.id), proposed=None, failed=None)
    if decision.orders:
        return replace(plans, made=made, proposed=plan, failed=None)
    return replace(plans, made=made, proposed=None, failed=plan)


def with_proposal_flying(plans: Plans) -> Plans:
    """Return the plans of which the proposed one flies. Raises ValueError if there is none."""
    if plans.proposed is None:
        raise ValueError("no plan is proposed")
    return replace(plans, flying=plans.proposed, proposed=None)


def with_proposal_refused(plans: Plans, reason: str) -> Plans:
    """Return the plans of which the proposed one cannot fly any more. Raises ValueError if there is none."""
    if plans.proposed is None:
        raise ValueError("no plan is proposed")
    plan = plans.proposed
    return replace(plans, proposed=None, failed=replace(plan, decision=replace(plan.decision, reason=reason)))


def without_threats(plans: Plans) -> Plans:
    """Return the plans after the last threat has left: no plan holds any more; hosts hover where they are."""
    return replace(plans, proposed=None, flying=None, failed=None)
