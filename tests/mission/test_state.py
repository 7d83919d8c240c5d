"""When a plan is due, and what becomes of it."""

from dataclasses import replace

import pytest

from hsop_gcs.assignment import HostOrder, Mover
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.detections.merging import SOURCE
from hsop_gcs.mission.core import MissionState, apply
from hsop_gcs.mission.inputs import ProposalRefused
from hsop_gcs.mission.planning import Decision, PlanningRules, Sigma, Situation
from hsop_gcs.mission.records import from_record, to_record
from hsop_gcs.mission.state import (
    Plans,
    ReplanRules,
    ready,
    replan_reason,
    with_decision,
    with_proposal_flying,
)
from hsop_gcs.placement.problem import Formulation, Objective, Point, Threat
from hsop_gcs.placement.solution import HoverPose, Placement, Status, ThreatPair, View
from hsop_gcs.reports import Report
from hsop_gcs.tracks import Picture, Track, TrackRules, TrackStatus, update

RULES = ReplanRules(departure_m=5.0)
PLANNING = PlanningRules(horizon_s=10.0)
HOSTS = tuple(Mover(id=host, position_m=(0.0, 0.0, 40.0), speed_mps=8.0) for host in ("h1", "h2"))


def due(plans: Plans, tracks: tuple[Track, ...], movers: tuple[Mover, ...], now_s: float) -> str | None:
    return replan_reason(plans, tracks, movers, now_s, RULES, PLANNING)


def begun(report: Report, now_s: float) -> Track:
    """The track that a report begins."""
    picture, (name,) = update(Picture(), [report], now_s, TrackRules())
    return picture.tracks[str(name)]


def track(name: str, time_s: float, east: float, velocity: Point | None = (1.0, 0.0, 0.0)) -> Track:
    place = (east, 0.0, 40.0)
    report = Report(source="radar", threat_id=name, time_s=time_s, position_m=place, velocity_mps=velocity, sigma_m=0.5)
    return begun(report, time_s)


def decision(*threats: Threat, orders: bool = True) -> Decision:
    """Two hosts look at all threats with their central cameras, from 25 m beside a path that leads east at 40 m."""
    poses = tuple(
        HoverPose(host=host, position_m=(-10.0, north, 40.0), heading_deg=0.0, pan_deg=90.0)
        for host, north in (("h1", -25.0), ("h2", 25.0))
    )
    views = (View(host="h1", camera=CameraKind.CENTRAL), View(host="h2", camera=CameraKind.CENTRAL))
    made = tuple(
        HostOrder(host=pose.host, position_m=pose.position_m, heading_deg=0, aim=None, views=()) for pose in poses
    )
    placement = Placement(
        status=Status.FEASIBLE if orders else Status.INFEASIBLE,
        formulation=Formulation.OPERATIONAL,
        objective=Objective.LETTER,
        hosts=poses,
        pairs=tuple(ThreatPair(threat=threat.id, views=views, cost=1.0) for threat in threats),
    )
    return Decision(
        placement=placement,
        threats=threats,
        window_start_s=105.0,
        orders=made if orders else (),
        reason="" if orders else "too far apart",
    )


def asked(*threats: Threat, sigma_m: float = 0.5, now_s: float = 100.0) -> Situation:
    sigmas = tuple(Sigma(position_m=sigma_m, velocity_mps=0.0) for _ in threats)
    return Situation(now_s=now_s, threats=threats, sigmas=sigmas, movers=())


def planned(orders: bool = True, sigma_m: float = 0.5) -> Plans:
    """A plan made at 100 s for one threat that is at 5 m east when its window starts at 105 s."""
    threat = Threat(id="t1", position_m=(5.0, 0.0, 40.0), velocity_mps=(1.0, 0.0, 0.0))
    return with_decision(
        Plans(),
        decision(threat, orders=orders),
        asked=asked(threat, sigma_m=sigma_m),
        trigger="threat t1 appeared",
        now_s=100.0,
        horizon_s=10.0,
    )


def test_a_first_threat_asks_for_a_plan() -> None:
    assert due(Plans(), (track("t1", 100, 0),), HOSTS, 100.0) == "threat t1 appeared"


def test_without_threats_there_is_nothing_to_plan() -> None:
    assert due(planned(), (), HOSTS, 200.0) is None


def test_a_threat_that_keeps_to_its_prediction_asks_for_nothing() -> None:
    for now_s in (100.0, 107.0, 114.9):
        assert due(planned(), (track("t1", now_s, now_s - 100.0),), HOSTS, now_s) is None


@pytest.mark.parametrize(
    ("tracks", "hosts", "now_s", "reason"),
    [
        ((track("t1", 108, 8), track("t2", 108, 50)), HOSTS, 108.0, "threat t2 appeared"),
        ((track("t2", 108, 50),), HOSTS, 108.0, "threat t2 appeared"),
        ((track("t1", 108, 20),), HOSTS, 108.0, "threat t1 is 12 m from its prediction: too far from a camera"),
        ((track("t1", 116, 16),), HOSTS, 116.0, "the horizon has run out"),
        ((track("t1", 108, 8),), HOSTS[:1], 108.0, "host h2 is not available any more"),
    ],
)
def test_a_plan_is_due_when(tracks: tuple[Track, ...], hosts: tuple[Mover, ...], now_s: float, reason: str) -> None:
    assert due(planned(), tracks, hosts, now_s) == reason


def test_a_plan_that_a_threat_departs_from_goes_on_while_its_hosts_can_do_what_they_are_for() -> None:
    assert due(planned(), (track("t1", 108, 0),), HOSTS, 108.0) is None
    reason = "threat t1 is 23 m from its prediction: too near to a hover point"
    assert due(planned(), (track("t1", 108, -15, velocity=(0.0, 2.0, 0.0)),), HOSTS, 108.0) == reason


def test_a_plan_is_due_when_its_hosts_should_be_there_and_one_has_not_been_able_to_depart() -> None:
    flying, tracks = with_proposal_flying(planned()), (track("t1", 106, 6),)
    assert replan_reason(flying, tracks, HOSTS, 104.0, RULES, PLANNING, ["h2"]) is None
    reason = "host h2 should be there and still waits to depart"
    assert replan_reason(flying, tracks, HOSTS, 106.0, RULES, PLANNING, ["h2"]) == reason


def test_a_plan_is_due_at_once_when_a_host_of_it_cannot_get_to_its_hover_point() -> None:
    flying, tracks = with_proposal_flying(planned()), (track("t1", 103, 3),)
    at = [replan_reason(flying, tracks, HOSTS, now_s, RULES, PLANNING, ["h2"], ["h2"]) for now_s in (101.9, 102.1)]
    assert at == [None, "host h2 cannot get to its hover point"]
    assert replan_reason(planned(), tracks, HOSTS, 103.0, RULES, PLANNING, ["h2"], ["h2"]) is None, "one is proposed"


def test_a_plan_that_is_kept_although_a_host_waits_is_not_asked_for_again_at_once() -> None:
    threat, now_s = Threat(id="t1", position_m=(6.0, 0.0, 40.0), velocity_mps=(1.0, 0.0, 0.0)), 106.0
    keeps = replace(decision(threat), keeps=True, window_start_s=now_s)
    flying = with_proposal_flying(planned())
    kept = with_decision(flying, keeps, asked=asked(threat), trigger="", now_s=now_s, horizon_s=10.0)
    assert replan_reason(kept, (track("t1", 107, 7),), HOSTS, 107.0, RULES, PLANNING, ["h2"]) is None
    reason = "host h2 should be there and still waits to depart"
    assert replan_reason(kept, (track("t1", 109, 9),), HOSTS, 109.0, RULES, PLANNING, ["h2"]) == reason


def test_a_threat_that_left_asks_for_a_plan_without_it() -> None:
    both = decision(
        Threat(id="t1", position_m=(5.0, 0.0, 40.0), velocity_mps=(1.0, 0.0, 0.0)),
        Threat(id="t2", position_m=(90.0, 0.0, 40.0)),
    )
    state = with_decision(Plans(), both, asked=asked(*both.threats), trigger="", now_s=100.0, horizon_s=10.0)
    assert due(state, (track("t1", 101, 1),), HOSTS, 101.0) == "threat t2 left"


def test_a_coarse_report_off_by_its_own_sigma_is_no_departure() -> None:
    report = Report(source="r", threat_id="t1", time_s=108.0, position_m=(20.0, 0.0, 40.0), sigma_m=5.0)
    coarse = begun(report, 108.0)
    assert due(planned(), (coarse,), HOSTS, 108.0) is None


def test_a_plan_is_due_when_a_velocity_becomes_known_that_it_was_not_made_for() -> None:
    def climbing(velocity_sigma_mps: float) -> Track:
        report = Report(
            source="r",
            threat_id="t1",
            time_s=106.0,
            position_m=(6.0, 0.0, 40.0),
            velocity_mps=(1.0, 0.0, 6.0),
            sigma_m=0.5,
            velocity_sigma_mps=velocity_sigma_mps,
        )
        return begun(report, 106.0)

    reason = "threat t1 will be 54 m from its prediction: too far from a camera"
    assert due(planned(), (climbing(0.2),), HOSTS, 106.0) == reason
    assert due(planned(), (climbing(3.0),), HOSTS, 106.0) is None


def test_a_plan_for_a_coarse_track_waits_until_it_is_known_well() -> None:
    coarse = planned(sigma_m=15.0)
    report = Report(source="r", threat_id="t1", time_s=104.0, position_m=(20.0, 0.0, 40.0), sigma_m=10.0)
    still_coarse = begun(report, 104.0)
    assert due(coarse, (still_coarse,), HOSTS, 104.0) is None
    known = (track("t1", 108, 20),)
    assert due(coarse, known, HOSTS, 108.0) == "threat t1 is 12 m from its prediction: too far from a camera"
    assert due(coarse, (track("t1", 108, 8),), HOSTS, 108.0) is None


def test_a_decision_that_keeps_the_flying_plan_gives_it_more_time() -> None:
    flying = with_proposal_flying(planned())
    keeps = replace(decision(), keeps=True)
    kept = with_decision(flying, keeps, asked=asked(), trigger="", now_s=112.0, horizon_s=10.0)
    assert kept.flying is not None
    assert (kept.flying.id, kept.flying.expires_at_s, kept.proposed) == ("P1", 115.0, None)


def test_after_a_failure_the_next_try_waits() -> None:
    failed = planned(orders=False)
    assert failed.failed is not None
    assert failed.proposed is None
    assert due(failed, (track("t1", 101, 1),), HOSTS, 101.0) is None
    assert due(failed, (track("t1", 102, 2),), HOSTS, 102.1) == "no plan yet"


def test_an_approved_plan_flies_and_a_failure_after_it_leaves_it_flying() -> None:
    flying = with_proposal_flying(planned())
    assert flying.flying is not None
    assert flying.proposed is None
    after = with_decision(flying, decision(orders=False), asked=asked(), trigger="", now_s=110.0, horizon_s=10.0)
    assert after.flying is flying.flying
    assert after.failed is not None


def test_a_newer_plan_replaces_a_proposal() -> None:
    newer = with_decision(planned(), decision(), asked=asked(), trigger="", now_s=111.0, horizon_s=10.0)
    assert newer.proposed is not None
    assert newer.proposed.id == "P2"


def test_a_proposal_that_cannot_fly_any_more_is_over_and_another_one_is_made() -> None:
    mission = MissionState(plans=planned())
    given = ProposalRefused(time_s=103.0, reason="host h2 has no way")
    after = apply(mission, from_record(*to_record(given), given.time_s)).plans
    assert after.proposed is None
    assert after.failed is not None
    assert after.failed.decision.reason == "host h2 has no way"
    assert due(after, (track("t1", 103, 3),), HOSTS, 103.1) == "no plan yet"


def test_nothing_to_approve_is_a_caller_s_mistake() -> None:
    with pytest.raises(ValueError, match="no plan is proposed"):
        with_proposal_flying(Plans())


def test_a_threat_without_a_velocity_is_given_a_moment_to_show_one() -> None:
    unknown = track("t1", 100, 0, velocity=None)
    assert ready((unknown,), 100.5, RULES) == ()
    assert ready((unknown,), 102.0, RULES) == (unknown,)


def test_what_only_cameras_have_seen_is_planned_for_while_they_see_it() -> None:
    seen = replace(track("T1", 100, 0), source=SOURCE, sources=())
    assert ready((seen,), 100.5, RULES) == (seen,)
    coasting = replace(seen, status=TrackStatus.COASTING)
    assert ready((coasting,), 103.0, RULES) == ()
    reported = replace(coasting, source="radar")
    assert ready((reported,), 103.0, RULES) == (reported,)
