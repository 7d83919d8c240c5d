"""The rest of the API: hosts nobody hears, plans that are not there, and the OpenAPI document."""

from collections.abc import Iterator

import httpx2
import pytest

from hsop_gcs.api.schemas import ReportIn
from tests.service import service, settings


@pytest.fixture(scope="module")
def client() -> Iterator[httpx2.Client]:
    with service(settings()) as client:
        yield client


def test_a_host_nobody_hears_is_shown_as_such(client: httpx2.Client) -> None:
    hosts = client.get("/api/v1/hosts").json()
    assert [(host["id"], host["link_up"], host["available"]) for host in hosts] == [
        ("h1", False, False),
        ("h2", False, False),
    ]
    assert "no link" in hosts[0]["unavailable_reason"]
    health = client.get("/api/v1/health").json()
    assert health["status"] == "degraded"
    assert any("h1" in each for each in health["problems"])


@pytest.mark.parametrize(
    ("path", "body", "status", "word"),
    [
        ("/api/v1/plan/approve", {"plan_id": "P7"}, 404, "P7"),
        ("/api/v1/plan/approve", {}, 422, "plan_id"),
        ("/api/v1/plan/approve", {"plan_id": "P7", "force": True}, 422, "force"),
        ("/api/v1/hosts/take-off", {"altitude_m": 20, "hosts": ["h9"]}, 404, "h9"),
        ("/api/v1/hosts/take-off", {"altitude_m": 2000}, 422, "2000"),
        ("/api/v1/hosts/hold", {"hosts": "h1"}, 422, "hosts"),
        ("/api/v1/nothing", {}, 404, "Not Found"),
    ],
)
def test_wishes_that_cannot_be_granted_are_problems(
    client: httpx2.Client, path: str, body: object, status: int, word: str
) -> None:
    answer = client.post(path, json=body)
    assert answer.status_code == status
    assert answer.headers["content-type"] == "application/problem+json"
    assert word in answer.json()["detail"]


def test_the_wrong_method_is_a_problem_too(client: httpx2.Client) -> None:
    answer = client.get("/api/v1/reports")
    assert answer.status_code == 405
    assert answer.headers["content-type"] == "application/problem+json"


def test_the_openapi_document_shows_a_report_that_is_accepted_as_it_stands(client: httpx2.Client) -> None:
    document = client.get("/openapi.json").json()
    schema = document["components"]["schemas"]["ReportIn"]
    ReportIn.model_validate(schema["examples"][0])
    body = document["paths"]["/api/v1/reports"]["post"]["requestBody"]["content"]["application/json"]["schema"]
    assert body["anyOf"][0] == {"$ref": "#/components/schemas/ReportIn"}
    assert {"PositionIn", "AltitudeDatum", "Problem"} <= set(document["components"]["schemas"])
