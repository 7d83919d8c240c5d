"""POST /api/v1/reports: each report judged by itself, every fault named, nothing accepted ever lost."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx2
import pytest

from tests.service import position, report, service, settings


@pytest.fixture(scope="module")
def client() -> Iterator[httpx2.Client]:
    with service(settings()) as client:
        yield client


def post(client: httpx2.Client, body: Any) -> httpx2.Response:
    text = body if isinstance(body, bytes) else json.dumps(body).encode()
    return client.post("/api/v1/reports", content=text, headers={"content-type": "application/json"})


def is_problem(answer: httpx2.Response, status: int) -> dict[str, Any]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    body: dict[str, Any] = answer.json()
    assert body["status"] == status
    assert "Traceback" not in answer.text
    return body


def test_a_report_is_in_the_picture_at_once(client: httpx2.Client) -> None:
    answer = post(client, report("at-once"))
    assert answer.status_code == 200
    assert answer.json()["results"] == [{"index": 0, "status": "accepted", "threat": "at-once", "errors": []}]
    threat = next(each for each in client.get("/api/v1/threats").json() if each["id"] == "at-once")
    assert threat["position"]["altitude_amsl_m"] == pytest.approx(528.0, abs=0.01)
    assert threat["position_enu_m"][:2] == pytest.approx([0.0, 100.1], abs=0.1)
    assert threat["velocity_enu_mps"] == [0.5, -0.5, 0.0]


def test_a_bad_report_among_good_ones_costs_only_itself(client: httpx2.Client) -> None:
    answer = post(client, [report("g1"), report("bad", position=position(lat_deg=95)), report("g2"), "not a report"])
    assert answer.status_code == 200
    body = answer.json()
    assert (body["accepted"], body["rejected"]) == (2, 2)
    assert [result["status"] for result in body["results"]] == ["accepted", "rejected", "accepted", "rejected"]
    assert body["results"][1]["errors"][0]["field"] == "position.lat_deg"
    assert "95" in body["results"][1]["errors"][0]["problem"]
    assert {"g1", "g2"} <= {each["id"] for each in client.get("/api/v1/threats").json()}


FUTURE = (datetime.now(UTC) + timedelta(days=365)).isoformat()


@pytest.mark.parametrize(
    ("change", "field", "shown"),
    [
        ({"position": position(lat_deg=95)}, "position.lat_deg", "95"),
        ({"position": position(lat_deg="47.4")}, "position.lat_deg", "47.4"),
        ({"position": position(lat_deg=True)}, "position.lat_deg", "True"),
        ({"position": position(lat_deg=float("nan"))}, "position.lat_deg", "nan"),
        ({"position": position(altitude_m=float("inf"))}, "position.altitude_m", "inf"),
        ({"position": position(altitude_datum=None)}, "position.altitude_datum", "required"),
        ({"position": position(altitude_datum="msl")}, "position.altitude_datum", "msl"),
        ({"position": position(altitude_datum="hae")}, "position.altitude_datum", "geoid_separation_m"),
        ({"position": position(lat_deg=0.0, lon_deg=0.0)}, "position", "no fix"),
        ({"position": position(lat_deg=-47.0)}, "position", "km from the mission"),
        ({"time": FUTURE}, "time", "future"),
        ({"time": "2026-01-31T12:00:00"}, "time", "2026-01-31T12:00:00"),
        ({"time": "2026-01-31T12:00:00Z"}, "time", "old"),
        ({"time": 5}, "time", "RFC 3339"),
        ({"time": "yesterday"}, "time", "yesterday"),
        ({"velocity": {"east_mps": 1e9, "north_mps": 0.0}}, "velocity.east_mps", "1000000000"),
        ({"size_m": 0}, "size_m", "0"),
        ({"sigma_m": -1}, "sigma_m", "-1"),
        ({"source": ""}, "source", "''"),
        ({"source": " "}, "source", "not blank"),
        ({"source": "radar\x1b[2J"}, "source", "printable"),
        ({"source": "\ud800"}, "source", "ud800"),
        ({"colour": "red"}, "colour", "red"),
    ],
)
def test_a_fault_is_answered_with_its_field_and_value(
    client: httpx2.Client, change: dict[str, Any], field: str, shown: str
) -> None:
    body = is_problem(post(client, report("faulty", **change)), 422)
    assert body["errors"][0]["field"] == field
    assert shown in body["errors"][0]["problem"]
    assert "faulty" not in {each["id"] for each in client.get("/api/v1/threats").json()}


@pytest.mark.parametrize("body", [b"{", b"", b"\xff\xfe{}", b"[" * 100_000, b"1" * 5000, b'{"source": "radar",}'])
def test_what_is_not_json_is_said_so(client: httpx2.Client, body: bytes) -> None:
    assert "not JSON" in is_problem(post(client, body), 400)["detail"]


@pytest.mark.parametrize("body", [3, None, "report", [], [{}] * 1001])
def test_what_is_no_report_and_no_list_of_them_is_refused(client: httpx2.Client, body: Any) -> None:
    is_problem(post(client, body), 422)


@pytest.mark.parametrize("announced", [True, False])
def test_ten_megabytes_are_refused_and_the_service_goes_on(client: httpx2.Client, announced: bool) -> None:
    before, after = f"before-{announced}", f"after-{announced}"
    assert post(client, report(before)).status_code == 200
    flood = [b'{"source": "', *[b"x" * 100_000] * 100, b'"}']
    is_problem(client.post("/api/v1/reports", content=b"".join(flood) if announced else iter(flood)), 413)
    assert post(client, report(after)).status_code == 200
    assert {before, after} <= {each["id"] for each in client.get("/api/v1/threats").json()}


def test_refused_reports_are_counted_by_field(client: httpx2.Client) -> None:
    before = client.get("/api/v1/health").json()["reports"]
    post(client, [report("count", sigma_m=-1), report("count")])
    after = client.get("/api/v1/health").json()["reports"]
    assert after["accepted"] == before["accepted"] + 1
    assert after["refused_by_field"]["sigma_m"] == before["refused_by_field"].get("sigma_m", 0) + 1


def test_a_source_of_which_everything_is_refused_is_named_whatever_is_wrong(client: httpx2.Client) -> None:
    for _ in range(3):
        is_problem(post(client, report("t1", source="old", position=position(altitude_datum="hae"))), 422)
        is_problem(post(client, report("t1", source="tin", time="yesterday")), 422)
    told = [each for each in client.get("/api/v1/health").json()["problems"] if each.startswith("source")]
    assert [each.partition(": ")[0] for each in told] == ["source 'tin'", "source 'old'"]
    assert "position.altitude_datum: 'hae' needs site.geoid_separation_m" in told[1]
    post(client, report("t9", source="old")).raise_for_status()
    told = [each for each in client.get("/api/v1/health").json()["problems"] if each.startswith("source")]
    assert [each.partition(": ")[0] for each in told] == ["source 'tin'"]


def test_a_report_repeated_is_refused_and_the_track_kept(client: httpx2.Client) -> None:
    once = report("repeated")
    assert post(client, once).status_code == 200
    assert is_problem(post(client, once), 422)["errors"][0]["field"] == "time"
    assert [each["reports"] for each in client.get("/api/v1/threats").json() if each["id"] == "repeated"] == [1]


def test_how_far_a_sources_clock_is_off_is_shown(client: httpx2.Client) -> None:
    elsewhere = position(lon_deg=8.56)  # where no other test's track is: it would be too late for one
    late = report("t9", source="behind", late_s=5.0, position=elsewhere)
    client.post("/api/v1/reports", json=late).raise_for_status()
    source = client.get("/api/v1/health").json()["reports"]["sources"]["behind"]
    assert -15.0 < source["clock_offset_s"] <= -5.0
    assert source["clock_samples"] == 1
