"""What the routes bound: names in commands, what is echoed and counted of a client's words, and large bodies."""

from collections.abc import Iterator
from typing import Any

import httpx2
import pytest

from tests.service import report, service, settings

JSON = {"content-type": "application/json"}


@pytest.fixture(scope="module")
def client() -> Iterator[httpx2.Client]:
    with service(settings()) as client:
        yield client


def told(answer: httpx2.Response, status: int) -> dict[str, Any]:
    assert answer.status_code == status, answer.text[:300]
    assert answer.headers["content-type"] == "application/problem+json"
    assert len(answer.content) < 3000, "what a client sends is not sent back whole"
    body: dict[str, Any] = answer.json()
    return body


@pytest.mark.parametrize("command", ["hold", "recall", "release", "take-off"])
def test_names_without_number_are_refused_with_the_bound(client: httpx2.Client, command: str) -> None:
    body: dict[str, Any] = {"hosts": [f"host-{number}" for number in range(100_000)], "altitude_m": 20.0}
    problem = told(client.post(f"/api/v1/hosts/{command}", json=body), 422)
    assert problem["errors"][0]["field"] == "body"
    assert "at most 65536" in problem["errors"][0]["problem"]
    few = {"hosts": body["hosts"][:300]} if command != "take-off" else {**body, "hosts": body["hosts"][:300]}
    problem = told(client.post(f"/api/v1/hosts/{command}", json=few), 422)
    assert problem["errors"][0]["field"] == "hosts"
    assert "at most 250" in problem["errors"][0]["problem"]


def test_names_are_as_many_as_there_are_hosts_each_once(client: httpx2.Client) -> None:
    assert client.post("/api/v1/hosts/hold", json={"hosts": ["h2", "h1", "h2"] * 50}).json() == {"hosts": ["h2", "h1"]}
    for body in (b"", b"{}", b"null"):
        answer = client.post("/api/v1/hosts/hold", content=body, headers={"content-type": "application/json"})
        assert answer.json() == {"hosts": ["h1", "h2"]}
    problem = told(client.post("/api/v1/hosts/hold", json={"hosts": ["h1", "h2", "h3"]}), 422)
    assert problem["detail"] == "hosts: 3 hosts are named, and the fleet has 2"


def test_all_are_meant_by_saying_so_and_by_a_hold_that_names_nobody(client: httpx2.Client) -> None:
    for command, body in (("hold", {}), ("hold", {"hosts": "all"}), ("recall", {"hosts": "all"})):
        assert client.post(f"/api/v1/hosts/{command}", json=body).json()["hosts"] == ["h1", "h2"]
    assert client.post("/api/v1/hosts/release", json={"hosts": "all"}).json() == {"hosts": ["h1", "h2"]}
    assert [host["pending"] for host in client.get("/api/v1/hosts").json()] == [None, None]


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("POST", "hosts/hold", {"hosts": ["h" * 60_000]}, 422),
        ("POST", "hosts/hold", {"hosts": "h" * 60_000}, 422),
        ("POST", "hosts/hold", {"h" * 60_000: 1}, 422),
        ("POST", "hosts/hold", {f"field{number}": number for number in range(4000)}, 422),
        ("POST", "plan/approve", {"plan_id": "P" * 60_000}, 422),
        ("POST", "hosts/register", {"host": "h1", "address": "1" * 60_000}, 422),
        ("DELETE", "threats/" + "t" * 5000, None, 422),
        ("GET", "events?after=" + "9" * 5000, None, 422),
        ("GET", "n" * 5000, None, 404),
        ("POST", "reports", report("x" * 7000), 422),
        ("POST", "reports", report() | {"f" * 7000: 1}, 422),
        ("POST", "reports", report() | {f"f{number}": 1 for number in range(500)}, 422),
        ("POST", "reports", report(position={f"f{number}": 1 for number in range(500)}), 422),
        ("POST", "reports", [report("x" * 9000)], 422),
        ("POST", "detections", {"host": "h" * 7000}, 422),
    ],
)
def test_long_words_are_refused_and_echoed_short(
    client: httpx2.Client, method: str, path: str, body: Any, status: int
) -> None:
    told(client.request(method, f"/api/v1/{path}", json=body), status)


def test_refusals_are_counted_by_our_words_only(client: httpx2.Client) -> None:
    for number in range(20):
        client.post("/api/v1/reports", json=report() | {f"invented{number}": 1})
        client.post("/api/v1/detections", json={f"invented{number}": 1})
    counts = client.get("/api/v1/health").json()["reports"]["refused_by_field"]
    assert counts["unknown field"] >= 20
    assert not any("invented" in field for field in counts)


@pytest.mark.parametrize(
    ("body", "status", "word"),
    [
        (b"[" + b"{}," * 300_000 + b"{}]", 422, "more than 1000"),
        (b"[" + b" " * 900_000 + b"]", 422, "0 reports"),
        (b"[" + b"[[]]," * 190_000 + b"1]", 422, "more than 1000"),
        (b'{"a": [' + b"0," * 400_000 + b"0]}", 422, "more than 8192 characters"),
        (b'[{"source": "' + b"x" * 900_000 + b'"}]', 422, "more than 8192 characters"),
        (b"[" + b"9" * 900_000 + b"]", 400, "digits"),
        (b"[" * 900_000, 400, "not JSON"),
        (b"[{}, {}", 400, "line 1 column 8"),
        (b"[{},\n {},]", 400, "line 2 column 5"),
        (b"[{}] x", 400, "line 1 column 6"),
        (b'{"a": 1, "b": tru}', 400, "line 1 column 15"),
    ],
)
def test_json_is_parsed_no_farther_than_it_can_be_reports(
    client: httpx2.Client, body: bytes, status: int, word: str
) -> None:
    assert word in told(client.post("/api/v1/reports", content=body, headers=JSON), status)["detail"]
