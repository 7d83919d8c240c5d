"""What-if placements over the API: a plan or a frontier, nothing flown, and the service goes on meanwhile."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx2
import pytest

from hsop_gcs.api.placements import MAX_AT_ONCE
from tests.oracles.check_plan import check
from tests.placement.examples import read
from tests.service import service, settings

TWO: dict[str, Any] = read("2-threats-102")


@pytest.fixture(scope="module")
def client() -> Iterator[httpx2.Client]:
    with service(settings(2)) as client:
        client.timeout = httpx2.Timeout(150)
        yield client


def ask(client: httpx2.Client, **question: Any) -> httpx2.Response:
    return client.post("/api/v1/placements", json={"scenario": TWO, **question})


def test_a_scenario_is_answered_with_a_plan_and_nothing_flies(client: httpx2.Client) -> None:
    answer = ask(client, n_hosts=3, formulation="letter", time_limit_s=0.3)
    assert answer.status_code == 200, answer.text
    plan = answer.json()
    assert plan["n_hosts"] == 3
    verdict = check(TWO, plan, segment=False)
    assert verdict["ok"], verdict["problems"]
    plans = client.get("/api/v1/plan").json()
    assert plans["proposed"] is None
    assert plans["flying"] is None


def test_a_frontier_has_a_plan_for_every_number_of_hosts_at_falling_cost(client: httpx2.Client) -> None:
    answer = ask(client, frontier=True, formulation="letter", time_limit_s=0.5)
    rows = answer.json()["frontier"]
    assert [row["n_hosts"] for row in rows] == [2, 3, 4]
    costs = [row["cost"] for row in rows]
    assert costs == sorted(costs, reverse=True)
    for row in rows:
        assert check(TWO, row["plan"], segment=False)["ok"]


def test_a_target_error_is_met_with_the_hosts_it_takes(client: httpx2.Client) -> None:
    plan = ask(client, target_error_m=50.0, time_limit_s=0.3).json()
    assert plan["n_hosts"] == 2
    assert max(pair["expected_error_m"] for pair in plan["pairs"]) <= 50.0


def test_an_infeasible_scenario_is_a_plan_that_says_why(client: httpx2.Client) -> None:
    jet = {"threats": [{"id": "jet", "position_m": [0, 0], "velocity_mps": [40, 0]}]}
    answer = ask(client, scenario=jet, time_limit_s=0.3)
    assert answer.status_code == 200
    assert answer.json()["status"] == "infeasible"
    assert "jet" in answer.json()["reason"]


@pytest.mark.parametrize(
    ("question", "field"),
    [
        ({"scenario": {"threats": []}}, "scenario.threats"),
        ({"scenario": {"threats": [{"id": "a", "position_m": ["x", 0]}]}}, "scenario.threats[0].position_m"),
        ({"scenario": {"threats": [{"id": "a", "position_m": [0, 0]}] * 2}}, "scenario.threats[1].id"),
        ({"scenario": {"threats": [{"id": f"t{k}", "position_m": [k, 0]} for k in range(51)]}}, "scenario.threats"),
        ({"n_hosts": 1}, "n_hosts"),
        ({"n_hosts": 5}, "n_hosts"),
        ({"n_hosts": 3, "frontier": True}, "frontier"),
        ({"time_limit_s": 11}, "time_limit_s"),
        ({"objective": "beauty"}, "objective"),
        ({"scenery": 1}, "scenery"),
    ],
)
def test_a_fault_is_told_by_its_field(client: httpx2.Client, question: dict[str, Any], field: str) -> None:
    answer = ask(client, **question)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["errors"][0]["field"] == field


def test_too_many_questions_at_once_are_refused_while_the_service_answers_others(client: httpx2.Client) -> None:
    with ThreadPoolExecutor(MAX_AT_ONCE + 2) as askers:
        asked = [askers.submit(ask, client, n_hosts=3, time_limit_s=2.0) for _ in range(MAX_AT_ONCE + 2)]
        while not any(each.done() for each in asked):
            client.get("/api/v1/health").raise_for_status()
            time.sleep(0.02)
        answers = [each.result() for each in asked]
    assert sorted(answer.status_code for answer in answers) == [200] * MAX_AT_ONCE + [503, 503]
    refused = next(answer for answer in answers if answer.status_code == 503)
    assert "ask again" in refused.json()["detail"]
