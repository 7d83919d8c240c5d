"""The service with a simulated fleet: real HTTP, real UDP, plans that fly or do not."""

from collections.abc import Callable
from typing import Any

import httpx2
import pytest

from tests.service import free_udp_port, position, report, service, settings, simulated_fleet, wait_until

Json = dict[str, Any]


def post(client: httpx2.Client, *reports: Json) -> None:
    client.post("/api/v1/reports", json=list(reports)).raise_for_status()


def plans(client: httpx2.Client) -> Json:
    answer: Json = client.get("/api/v1/plan").raise_for_status().json()
    return answer


def proposed(client: httpx2.Client) -> Json:
    return wait_until(lambda: plans(client)["proposed"])


def all_ready(client: httpx2.Client, count: int) -> None:
    """Wait until so many hosts can be sent, and for the planner: a threat that is reported once leaves after 10 s."""

    def ready() -> bool:
        health = client.get("/api/v1/health").json()
        return bool(health["hosts_available"] == count and health["planning"]["ready"])

    wait_until(ready, limit_s=120)  # compiling the kernels takes a minute


def keep_reporting(client: httpx2.Client, *threats: Json) -> Callable[[], None]:
    """Return a function that reports the threats once more, at the time of the call."""
    return lambda: post(client, *(threat | {"time": report()["time"]} for threat in threats))


STILL: Json = {"velocity": {"east_mps": 0.0, "north_mps": 0.0}}


def test_a_plan_waits_for_approval_flies_when_approved_and_ends_with_its_threat() -> None:
    port = free_udp_port()
    with service(settings(2, port)) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        post(client, report("t1", **STILL))
        plan = proposed(client)
        assert plan["trigger"] == "threat t1 appeared"
        assert all(host["order"] is None for host in client.get("/api/v1/hosts").json())

        for wrong in ("P0", "P99"):
            assert client.post("/api/v1/plan/approve", json={"plan_id": wrong}).status_code == 404
        client.post("/api/v1/plan/approve", json={"plan_id": plan["id"]}).raise_for_status()
        assert client.post("/api/v1/plan/approve", json={"plan_id": plan["id"]}).status_code == 409
        orders = [host["order"] for host in client.get("/api/v1/hosts").json()]
        assert {order["plan_id"] for order in orders} == {plan["id"]}
        wait_until(
            lambda: all(each["order"]["status"] != "sent" for each in client.get("/api/v1/hosts").json()), limit_s=10
        )
        assert plans(client)["flying"]["id"] == plan["id"]

        wait_until(lambda: not client.get("/api/v1/threats").json(), limit_s=20)
        wait_until(lambda: plans(client)["flying"] is None)
        kinds = {event["kind"] for event in client.get("/api/v1/events").json()}
        assert {"LinkUp", "OrderAccepted"} <= kinds


def test_in_auto_a_plan_flies_at_once_is_kept_while_it_holds_and_replaced_when_it_does_not() -> None:
    port = free_udp_port()
    with service(settings(2, port, autonomy="auto", horizon_s=2.0)) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        still = keep_reporting(client, report("t1", **STILL))
        still()
        first = wait_until(lambda: plans(client)["flying"])

        def on_station() -> bool:
            still()
            hosts = client.get("/api/v1/hosts").json()
            return all(host["order"] is not None and host["order"]["status"] == "on station" for host in hosts)

        def sent() -> int:
            return sum(each["kind"] == "OrderAccepted" for each in client.get("/api/v1/events").json())

        wait_until(on_station, limit_s=60)
        before, there = plans(client)["flying"], sent()

        def kept() -> bool:
            still()
            flying: Json = plans(client)["flying"]
            return bool(flying["made_at"] > before["made_at"]) and flying["trigger"] == "the horizon has run out"

        wait_until(kept, limit_s=40)
        assert plans(client)["flying"]["id"] == before["id"] == first["id"]
        assert sent() == there, "an unchanged plan is not sent again"

        both = keep_reporting(client, report("t1", **STILL), report("t2", position=position(lon_deg=8.5459), **STILL))

        def replaced() -> Json | None:
            both()
            flying: Json = plans(client)["flying"]
            return flying if flying["id"] != first["id"] else None

        assert wait_until(replaced, limit_s=40)["trigger"] == "threat t2 appeared"
        client.post("/api/v1/hosts/hold", json={}).raise_for_status()
        assert plans(client)["autonomy"] == "confirm"


def test_a_dismissed_threat_is_gone_with_its_plan_and_stays_away() -> None:
    port = free_udp_port()
    with service(settings(2, port)) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        post(client, report("t1", **STILL))
        proposed(client)
        assert client.delete("/api/v1/threats/t1").status_code == 204
        assert client.delete("/api/v1/threats/t1").status_code == 404
        assert plans(client)["proposed"] is None
        answer = client.post("/api/v1/reports", json=report("t1", **STILL))
        assert answer.status_code == 422
        assert "dismissed" in answer.json()["detail"]


def test_a_service_that_advises_flies_nothing() -> None:
    port = free_udp_port()
    with service(settings(2, port, autonomy="advise")) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        post(client, report("t1", **STILL))
        answer = client.post("/api/v1/plan/approve", json={"plan_id": proposed(client)["id"]})
        assert answer.status_code == 409
        assert "only advises" in answer.json()["detail"]
        assert plans(client)["flying"] is None


def test_a_threat_no_plan_can_cover_is_said_so_and_the_service_goes_on() -> None:
    port = free_udp_port()
    with service(settings(2, port)) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        post(client, report("fast", velocity={"east_mps": 90.0, "north_mps": 0.0}))
        failed = wait_until(lambda: plans(client)["failed"])
        assert failed["placement"]["status"] == "infeasible"
        assert "fast" in failed["reason"]
        assert any("fast" in problem for problem in client.get("/api/v1/health").json()["problems"])
        post(client, report("calm", position=position(lat_deg=47.3968), **STILL))
        assert {each["id"] for each in client.get("/api/v1/threats").json()} == {"fast", "calm"}
        plan = proposed(client)
        assert [pair["threat"] for pair in plan["placement"]["pairs"]] == ["calm"]
        assert list(plan["left_out"]) == ["fast"]
        assert any("left out" in problem for problem in client.get("/api/v1/health").json()["problems"])


def test_a_host_that_cannot_be_reached_is_left_out_and_shown() -> None:
    port = free_udp_port()
    with service(settings(3, port, hosts="all")) as client, simulated_fleet(port, 2):
        all_ready(client, 2)
        post(client, report("t1", **STILL))
        assert {order["host"] for order in proposed(client)["orders"]} == {"h1", "h2"}
        lost = client.get("/api/v1/hosts").json()[2]
        assert (lost["id"], lost["available"]) == ("h3", False)
        assert client.get("/api/v1/health").json()["status"] == "degraded"


@pytest.mark.parametrize("departure", ["appears", "turns"])
def test_a_new_plan_is_proposed_when_a_threat(departure: str) -> None:
    port = free_udp_port()
    with service(settings(4, port)) as client, simulated_fleet(port, 4):
        all_ready(client, 4)
        post(client, report("t1", **STILL))
        first = proposed(client)
        if departure == "appears":
            far = position(lon_deg=8.5464)
            post(client, report("t2", position=far, **STILL))
            tell, reason = keep_reporting(client, report("t1", **STILL)), "threat t2 appeared"
        else:
            moved = report("t1", position=position(lat_deg=47.3989), **STILL)
            tell, reason = keep_reporting(client, moved), "from its prediction"

        def another() -> Json | None:
            tell()
            plan: Json | None = plans(client)["proposed"]
            return None if plan is None or plan["id"] == first["id"] else plan

        newer = wait_until(another)
        assert reason in newer["trigger"]
