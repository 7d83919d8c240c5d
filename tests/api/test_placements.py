"""What-if placements over the API: a plan or a frontier, nothing flown, and the service goes on meanwhile."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx2
import pytest

from hsop_gcs.api.placements import MAX_AT_ONCE, MAX_PER_CLIENT
from tests.oracles.check_plan import check
from tests.placement.examples import read
from tests.service import service, settings, wait_until

TWO: dict[str, Any] = read("2-threats-102")
MANY = {"threats": [{"id": f"t{k}", "position_m": [60 * k, 0], "velocity_mps": [1, 1]} for k in range(40)]}


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
    plan = ask(client, target_error_m=50.0, time_limit_s=2.0).json()
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
    elsewhere = httpx2.Client(
        base_url=client.base_url, timeout=150, transport=httpx2.HTTPTransport(local_address="127.0.0.2")
    )
    with elsewhere, ThreadPoolExecutor(6) as askers:
        asked = [
            askers.submit(ask, asker, n_hosts=3, time_limit_s=2.0) for asker in (client, elsewhere) for _ in range(3)
        ]
        while not any(each.done() for each in asked):
            client.get("/api/v1/health").raise_for_status()
            time.sleep(0.02)
        answers = [each.result() for each in asked]
    for asker in (answers[:3], answers[3:]):
        assert sum(answer.status_code == 200 for answer in asker) <= MAX_PER_CLIENT
    assert sorted(answer.status_code for answer in answers) == [200] * MAX_AT_ONCE + [503] * 3
    refused = next(answer for answer in answers if answer.status_code == 503)
    assert "ask again" in refused.json()["detail"]


def test_a_question_whose_client_has_left_is_given_up(client: httpx2.Client) -> None:
    for _ in range(2 * MAX_PER_CLIENT):
        with pytest.raises(httpx2.ReadTimeout):
            client.post(
                "/api/v1/placements",
                json={"scenario": MANY, "time_limit_s": 10.0},
                timeout=httpx2.Timeout(10, read=0.2),
            )
    # nobody waits for the ones before any more: this one is taken, and long before they would have been answered
    wait_until(lambda: ask(client, n_hosts=3, time_limit_s=0.3).status_code == 200, limit_s=10.0)


@pytest.mark.parametrize(
    ("part", "field"),
    [
        ({"hosts": [{}] * 101}, "scenario.hosts"),
        ({"keep_outs": [{}] * 101}, "scenario.keep_outs"),
        ({"fence": [[0, 0]] * 1001}, "scenario.fence"),
        ({"keep_outs": [{"polygon": [[0, 0]] * 1001}]}, "scenario.keep_outs[0].polygon"),
        ({"x" * 10_000: 1}, "scenario"),
    ],
)
def test_a_scenario_has_no_more_of_anything_than_can_be_solved(
    client: httpx2.Client, part: dict[str, Any], field: str
) -> None:
    answer = ask(client, scenario={**TWO, **part})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"].startswith(field)
    assert len(answer.content) < 2000
