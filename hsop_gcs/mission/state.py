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

from hsop_gcs.detections.merging import is_only_seen
from hsop_gcs.mission.pipeline import Decision, Sigma, Situation
from hsop_gcs.tracks import Track, TrackStatus

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

    horizon_s: float = 10.0
    departure_m: float = 5.0
    """A threat this far from its prediction has departed from it, on top of what is uncertain now and, until it is
    known to this, of what was uncertain then."""
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
    plans: Plans, tracks: tuple[Track, ...], available: frozenset[str], now_s: float, rules: ReplanRules
) -> str | None:
    """Return why a new plan is due now, for a person, or None."""
    if not tracks:
        return None
    newest = plans.newest
    if newest is None:
        return f"threat {tracks[0].id} appeared"
    planned = {threat.id: threat for threat in newest.decision.threats}
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
    moments = [(now_s, "is")]
    if now_s > newest.made_at_s + _TRUSTED_S:
        moments += [(max(now_s, newest.decision.window_start_s), "will be"), (newest.expires_at_s, "will be")]
    for track in tracks:
        before, now = newest.sigmas[track.id], Sigma(position_m=track.sigma_m, velocity_mps=track.velocity_sigma_mps)
        is_known = now.position_m < rules.departure_m
        for at_s, verb in moments:
            predicted_m = planned[track.id].predicted_m(at_s - newest.decision.window_start_s)
            departed_m = math.dist(predicted_m, track.position_at(at_s))
            doubt_m = now.after(at_s - track.time_s)
            if not is_known:
                doubt_m = math.hypot(doubt_m, before.after(at_s - newest.asked_at_s))
            if departed_m > rules.departure_m + 3 * doubt_m:
                return f"threat {track.id} {verb} {departed_m:.0f} m from its prediction"
    if newest.decision.left_out and now_s > newest.made_at_s + rules.horizon_s:
        return f"threat {next(iter(newest.decision.left_out))} was left out"
    for order in newest.decision.orders:
        if order.host not in available:
            return f"host {order.host} is not available any more"
    if now_s > newest.expires_at_s:
        return "the horizon has run out"
    return None


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
