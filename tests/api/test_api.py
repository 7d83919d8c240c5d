"""The rest of the API: hosts nobody hears, plans that are not there, and the OpenAPI document."""

from collections.abc import Iterator
from typing import Any

import httpx2
import pytest
from pydantic import BaseModel

from hsop_gcs.api import detections, placements, schemas
from hsop_gcs.api.schemas import ReportIn
from tests.oracles.check_plan import check
from tests.service import report, service, settings

JSON = "application/json"


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


def test_a_recall_that_no_host_hears_is_shown_until_it_is_released(client: httpx2.Client) -> None:
    client.post("/api/v1/hosts/recall", json={"hosts": ["h2"]}).raise_for_status()
    h1, h2 = (host["pending"] for host in client.get("/api/v1/hosts").json())
    assert h1 is None
    assert (h2["command"], h2["by_operator"], h2["why"]) == ("return to launch", True, "no link to the vehicle")
    client.post("/api/v1/hosts/release", json={"hosts": "all"}).raise_for_status()
    assert [host["pending"] for host in client.get("/api/v1/hosts").json()] == [None, None]


@pytest.mark.parametrize(
    ("path", "body", "status", "word"),
    [
        ("/api/v1/plan/approve", {"plan_id": "P7"}, 404, "P7"),
        ("/api/v1/plan/approve", {}, 422, "plan_id"),
        ("/api/v1/plan/approve", {"plan_id": "P7", "force": True}, 422, "force"),
        ("/api/v1/hosts/take-off", {"altitude_m": 20, "hosts": ["h9"]}, 404, "h9"),
        ("/api/v1/hosts/take-off", {"altitude_m": 2000, "hosts": "all"}, 422, "2000"),
        ("/api/v1/hosts/take-off", {"altitude_m": 20}, 422, "hosts"),
        ("/api/v1/hosts/recall", {}, 422, "hosts"),
        ("/api/v1/hosts/release", {}, 422, "hosts"),
        ("/api/v1/hosts/recall", {"hosts": []}, 422, "hosts"),
        ("/api/v1/hosts/recall", {"hosts": None}, 422, "all"),
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


def test_a_fault_that_is_no_text_is_told_like_any_other(client: httpx2.Client) -> None:
    body = b'{"scenario": {"\\ud800": 1}}'
    answer = client.post("/api/v1/placements", content=body, headers={"content-type": JSON})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == "scenario.\ud800"


def test_a_threat_is_dismissed_whatever_its_source_calls_it(client: httpx2.Client) -> None:
    client.post("/api/v1/reports", json=report("north/7 ü")).raise_for_status()
    assert client.delete("/api/v1/threats/north%2F7%20%C3%BC").status_code == 204
    assert client.get("/api/v1/threats").json() == []


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


def model_of(content: dict[str, Any]) -> type[BaseModel]:
    """The model behind a body's schema; of an array, that of its items."""
    schema = content["schema"].get("anyOf", [content["schema"]])[0]
    name = schema.get("items", schema)["$ref"].rsplit("/", 1)[1]
    model: type[BaseModel] = next(vars(each)[name] for each in (schemas, detections, placements) if name in vars(each))
    return model


def test_every_body_asked_for_and_answered_has_an_example_of_its_own_form(client: httpx2.Client) -> None:
    document = client.get("/openapi.json").json()
    components = document["components"]["schemas"]
    operations = [each for path in document["paths"].values() for each in path.values()]
    asked = [each["requestBody"]["content"][JSON] for each in operations if "requestBody" in each]
    answered = [each["responses"]["200"]["content"][JSON] for each in operations if "200" in each["responses"]]
    assert (len(asked), len(answered)) == (9, 14)
    for model in map(model_of, asked):
        for example in components[model.__name__]["examples"]:
            model.model_validate(example)
    for model in (model_of(each) for each in answered if "example" not in each):
        for example in components[model.__name__]["examples"]:
            assert model.model_validate(example).model_dump(mode="json") == example
    assert "HTTPValidationError" not in str(document["paths"])
    assert set(components["Problem"]["required"]) <= set(components["Problem"]["examples"][0])


def test_the_placement_that_is_shown_answers_the_question_that_is_shown(client: httpx2.Client) -> None:
    document = client.get("/openapi.json").json()
    question = document["components"]["schemas"]["PlacementIn"]["examples"][0]
    answer = document["paths"]["/api/v1/placements"]["post"]["responses"]["200"]["content"][JSON]["example"]
    verdict = check(question["scenario"], answer, segment=True)
    assert verdict["ok"], verdict["problems"]
    assert answer["n_hosts"] == question["n_hosts"]
