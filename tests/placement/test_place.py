"""Placements of the letter's method, judged by a checker that shares no code with the project."""

import itertools
import math
from dataclasses import replace

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.placement import Method, place
from hsop_gcs.placement.problem import AvailableHost, Formulation, Objective, Problem, Threat
from hsop_gcs.placement.scenario import plan_to_json
from hsop_gcs.placement.solution import Placement, Status
from tests.oracles.check_plan import check
from tests.placement.examples import NAMES, problem, read

DEGREE = 1.0


def unhurried() -> float:
    """A clock that stands still: no time limit is ever reached."""
    return 0.0


def still(*places: tuple[float, float], formulation: Formulation = Formulation.OPERATIONAL) -> Problem:
    threats = tuple(Threat(id=f"t{k + 1}", position_m=(e, n, 0.0)) for k, (e, n) in enumerate(places))
    return Problem(threats=threats, formulation=formulation)


def used(placement: Placement) -> set[str]:
    return {view.host for pair in placement.pairs for view in pair.views}


@pytest.mark.parametrize("formulation", list(Formulation))
@pytest.mark.parametrize("name", NAMES)
def test_the_fewest_hosts_see_every_threat_and_the_checker_agrees(name: str, formulation: Formulation) -> None:
    placement = place(problem(name, formulation), method=Method.LETTER, now=unhurried)
    verdict = check(read(name), plan_to_json(placement), segment=formulation is Formulation.OPERATIONAL)
    assert verdict["ok"], verdict["problems"]
    assert len(placement.hosts) == 2
    assert placement.lower_bound <= (placement.cost or 0.0)
    places = [pose.position_m for pose in placement.hosts]
    if formulation is Formulation.OPERATIONAL:
        assert min(math.dist(a, b) for a, b in itertools.combinations(places, 2)) >= 10.0


@pytest.mark.parametrize("formulation", list(Formulation))
@pytest.mark.parametrize("n_hosts", [2, 3, 4])
def test_exactly_the_hosts_asked_for_are_placed_and_used(n_hosts: int, formulation: Formulation) -> None:
    placement = place(problem("2-threats-102", formulation), n_hosts=n_hosts, method=Method.LETTER, now=unhurried)
    verdict = check(read("2-threats-102"), plan_to_json(placement), segment=formulation is Formulation.OPERATIONAL)
    assert verdict["ok"], verdict["problems"]
    assert used(placement) == {f"h{k + 1}" for k in range(n_hosts)}


def test_more_hosts_cost_less_on_the_letters_two_threats() -> None:
    costs = [place(problem("2-threats-103"), n_hosts=n, method=Method.LETTER, now=unhurried).cost for n in (2, 3, 4)]
    assert costs == sorted(costs, key=lambda cost: -(cost or 0.0))


def test_a_threat_at_rest_with_hosts_of_its_own_is_placed_to_proven_optimality() -> None:
    placement = place(still((0.0, 0.0), formulation=Formulation.LETTER), method=Method.LETTER, now=unhurried)
    assert placement.status is Status.OPTIMAL
    assert placement.cost == pytest.approx(2 * (400 / 1280) ** 2, rel=1e-3)


def test_the_same_seed_gives_the_same_plan_and_another_seed_is_another_run() -> None:
    asked = problem("2-threats-104", Formulation.OPERATIONAL)
    first, second = (place(asked, seed=7, method=Method.LETTER, now=unhurried) for _ in range(2))
    assert first == second
    assert place(asked, seed=8, method=Method.LETTER, now=unhurried).hosts != first.hosts


def test_two_threats_beyond_the_reach_of_one_host_take_four() -> None:
    placement = place(still((0.0, 0.0), (190.0, 0.0)), method=Method.LETTER, now=unhurried)
    assert len(placement.hosts) == 4


def test_hosts_in_between_see_two_threats_and_a_third_far_one_takes_two_more() -> None:
    placement = place(still((0.0, 0.0), (60.0, 0.0), (260.0, 0.0)), method=Method.LETTER, now=unhurried)
    assert len(placement.hosts) == 4
    sharing = [{view.host for view in pair.views} for pair in placement.pairs]
    assert sharing[0] == sharing[1]
    assert sharing[0].isdisjoint(sharing[2])


def test_no_host_stands_in_any_threats_way_even_if_it_looks_at_another() -> None:
    crossing = Problem(
        threats=(
            Threat(id="t1", position_m=(0.0, 0.0, 0.0)),
            Threat(id="t2", position_m=(-35.0, 21.0, 0.0), velocity_mps=(5.0, 0.0, 0.0)),
        )
    )
    placement = place(crossing, n_hosts=4, method=Method.LETTER, now=unhurried)
    for pose in placement.hosts:
        for threat in crossing.threats:
            on_the_way = [threat.predicted_m(0.05 * step) for step in range(201)]
            assert min(math.dist(pose.position_m, point) for point in on_the_way) >= 20.0


def test_poses_carry_the_ids_of_the_hosts_and_the_nearest_ones_fly() -> None:
    hosts = tuple(
        AvailableHost(id=name, position_m=(east, 0.0, 0.0))
        for name, east in (("far", 4000.0), ("left", -40.0), ("right", 40.0))
    )
    placement = place(replace(still((0.0, 0.0)), hosts=hosts), method=Method.LETTER, now=unhurried)
    assert used(placement) == {pose.host for pose in placement.hosts} == {"left", "right"}


def test_initial_observers_look_at_the_threats_they_are_nearest_to() -> None:
    hosts = tuple(
        AvailableHost(id=name, position_m=(east, north, 0.0))
        for name, east, north in (("spare", 300.0, 0.0), ("b", 41.0, 20.0), ("a", 9.0, 40.0))
    )
    asked = replace(problem("2-threats-102"), hosts=hosts)
    placement = place(asked, n_hosts=3, initial_observers=True, now=unhurried)
    assert check(read("2-threats-102"), plan_to_json(placement))["ok"]
    seen_by = {pair.threat: {view.host for view in pair.views} for pair in placement.pairs}
    assert "a" in seen_by["t1"]
    assert "b" in seen_by["t2"]


def test_searching_all_pairs_and_cameras_is_no_dearer_than_the_letters_choice_of_them() -> None:
    asked = problem("2-threats-102")
    everything = place(asked, n_hosts=3, method=Method.LETTER, now=unhurried).cost
    letters = place(asked, n_hosts=3, letters_cameras=True, now=unhurried)
    assert check(read("2-threats-102"), plan_to_json(letters))["ok"]
    # Both are local searches from random starts: 1 % for luck.
    assert everything is not None
    assert everything <= (letters.cost or 0.0) * 1.01


@pytest.mark.parametrize("formulation", list(Formulation))
def test_coverage_only_keeps_the_rules_and_takes_no_notice_of_the_cost(formulation: Formulation) -> None:
    asked = problem("3-threats-106", formulation)
    covered = place(asked, method=Method.COVERAGE_ONLY, now=unhurried)
    assert check(read("3-threats-106"), plan_to_json(covered), segment=asked.formulation is Formulation.OPERATIONAL)[
        "ok"
    ]
    assert (covered.cost or 0.0) > (place(asked, method=Method.LETTER, now=unhurried).cost or 0.0)


def test_hosts_hover_at_the_threats_mean_altitude_and_tilt_to_what_they_see() -> None:
    flat = problem("1-threats-101")
    raised = replace(flat, threats=(replace(flat.threats[0], position_m=(56.61, 21.57, 80.0)),))
    placement = place(raised, method=Method.LETTER, now=unhurried)
    assert [pose.position_m[2] for pose in placement.hosts] == [80.0, 80.0]
    assert [pose.tilt_deg for pose in placement.hosts] == pytest.approx([0.0, 0.0], abs=1e-9 * DEGREE)


@pytest.mark.parametrize("formulation", list(Formulation))
def test_the_global_search_answers_through_the_same_entry(formulation: Formulation) -> None:
    asked = problem("2-threats-103", formulation)
    # A clock that jumps: past its deadline after the first look, so that one round is run.
    ticks = itertools.count()
    placement = place(asked, n_hosts=3, method=Method.SEARCH, time_limit_s=0.5, now=lambda: float(next(ticks)))
    verdict = check(read("2-threats-103"), plan_to_json(placement), segment=formulation is Formulation.OPERATIONAL)
    assert verdict["ok"], verdict["problems"]
    assert placement.method is Method.SEARCH


def refused(asked: Problem, n_hosts: int | None = None, initial_observers: bool = False) -> str:
    placement = place(asked, n_hosts=n_hosts, initial_observers=initial_observers, iterations=3, now=unhurried)
    assert placement.status is Status.INFEASIBLE
    assert placement.hosts == ()
    assert placement.cost is None
    return placement.reason


def test_too_long_a_path_is_named() -> None:
    fast = Problem(threats=(Threat(id="jet", position_m=(0.0, 0.0, 0.0), velocity_mps=(30.0, 0.0, 0.0)),))
    assert refused(fast).startswith(
        "threat jet flies 300.0 m within the horizon of 10 s; one host sees at most 182.3 m"
    )


def test_too_small_a_threat_is_named() -> None:
    tiny = Problem(threats=(Threat(id="bee", position_m=(0.0, 0.0, 0.0), size_m=0.02),))
    assert refused(tiny) == (
        "threat bee is detected no farther than 1.8 m away, which is inside the safety distance of 20 m"
    )


def test_too_few_hosts_are_counted_against_what_is_needed() -> None:
    hosts = tuple(AvailableHost(id=f"h{k}", position_m=(0.0, float(k), 0.0)) for k in range(3))
    asked = replace(still((0.0, 0.0), (190.0, 0.0)), hosts=hosts)
    assert refused(asked) == "3 hosts are available; at least 4 are needed to see every threat"
    assert refused(asked, n_hosts=3) == "no placement of 3 hosts sees every threat; 4 hosts can"
    assert refused(asked, n_hosts=4) == "4 hosts were asked for, 3 hosts are available"


@pytest.mark.parametrize(("count", "words"), [(0, "no host is"), (1, "1 host is")])
def test_less_than_two_hosts_are_never_enough(count: int, words: str) -> None:
    asked = replace(still((0.0, 0.0)), max_hosts=count)
    assert refused(asked) == f"{words} available; at least 2 are needed to see every threat"


def test_a_rule_that_costs_the_placement_is_named() -> None:
    # The last threat is nearest to the host that already observes the first one, 250 m away.
    hosts = tuple(
        AvailableHost(id=f"h{k}", position_m=(east, 0.0, 0.0)) for k, east in enumerate((249.0, 262.0, 264.0, 266.0))
    )
    asked = replace(still((0.0, 0.0), (5.0, 0.0), (0.0, 5.0), (250.0, 0.0), (255.0, 0.0)), hosts=hosts)
    assert refused(asked, initial_observers=True) == (
        "no placement keeps every threat's initial observer; without that rule 4 hosts see every threat"
    )


def test_a_time_limit_that_has_passed_is_the_reason_given() -> None:
    ticks = itertools.count()
    asked = problem("3-threats-105")
    placement = place(asked, method=Method.LETTER, now=lambda: float(next(ticks)), time_limit_s=0.5)
    assert placement.status is Status.INFEASIBLE
    assert placement.reason == "the time limit passed before a placement was found"


def test_a_time_limit_only_cuts_the_improvement_short() -> None:
    asked = problem("3-threats-105")
    whole = place(asked, n_hosts=4, method=Method.LETTER, now=unhurried)
    ticks = itertools.count()
    cut = place(asked, n_hosts=4, method=Method.LETTER, now=lambda: float(next(ticks)), time_limit_s=200.0)
    assert cut.status is Status.FEASIBLE
    assert check(read("3-threats-105"), plan_to_json(cut))["ok"]
    assert (cut.cost or 0.0) >= (whole.cost or 0.0)


@pytest.mark.parametrize("n_hosts", [-1, 0, 1, 3])
def test_a_number_of_hosts_that_cannot_all_be_used_is_bad_input(n_hosts: int) -> None:
    with pytest.raises(BadInput, match=rf"n_hosts: {n_hosts} is outside 2\.\.2"):
        place(still((0.0, 0.0)), n_hosts=n_hosts, method=Method.LETTER, now=unhurried)


def test_what_the_method_cannot_do_is_bad_input() -> None:
    with pytest.raises(BadInput, match="threats"):
        place(Problem(threats=()), method=Method.LETTER, now=unhurried)
    with pytest.raises(BadInput, match="threats: 't1' has a number that is not finite"):
        place(still((0.0, float("nan"))), now=unhurried)
    with pytest.raises(BadInput, match="initial observers"):
        place(still((0.0, 0.0)), initial_observers=True, now=unhurried)
    with pytest.raises(BadInput, match="objective: 'rms'"):
        place(replace(still((0.0, 0.0)), objective=Objective.RMS), method=Method.LETTER, now=unhurried)
    with pytest.raises(BadInput, match="method: 'search'"):
        place(still((0.0, 0.0)), method=Method.SEARCH, letters_cameras=True, now=unhurried)
