"""A host whose link is cut on the way: told, planned without, and used again once it is heard again."""

from typing import Any

import httpx2

from tests.service import free_udp_port, position, report, service, settings, simulated_fleet, wait_until

STILL: dict[str, Any] = {"east_mps": 0.0, "north_mps": 0.0}
THREATS = [report("t1", velocity=STILL), report("t2", velocity=STILL, position=position(lon_deg=8.5466))]
CUT_AT_S, CUT_FOR_S = 20, 12


def test_a_host_is_planned_without_while_its_link_is_cut_and_flies_again_after_it() -> None:
    port = free_udp_port()
    wanted = settings(3, port, autonomy="auto", hosts="all", horizon_s=4.0)
    fault = f"h1:link-cut@{CUT_AT_S}+{CUT_FOR_S}"

    def get(client: httpx2.Client, path: str) -> Any:
        return client.get(f"/api/v1/{path}").raise_for_status().json()

    def reported(client: httpx2.Client) -> None:
        now = {"time": report()["time"]}
        client.post("/api/v1/reports", json=[threat | now for threat in THREATS]).raise_for_status()

    with service(wanted) as client:
        wait_until(lambda: get(client, "health")["planning"]["ready"], limit_s=120)

        def flying_with(*hosts: str) -> dict[str, Any] | None:
            reported(client)
            plan: dict[str, Any] | None = get(client, "plan")["flying"]
            return plan if plan is not None and {order["host"] for order in plan["orders"]} == set(hosts) else None

        def told(kind: str) -> list[int]:
            events = get(client, "events")
            return [event["number"] for event in events if (event["kind"], event["host"]) == (kind, "h1")]

        with simulated_fleet(port, 3, "--fault", fault):
            wait_until(lambda: flying_with("h1", "h2", "h3"))
            without = wait_until(lambda: flying_with("h2", "h3"), limit_s=60)
            assert "h1" in without["trigger"]
            lost = wait_until(lambda: each if not (each := get(client, "hosts")[0])["link_up"] else None)
            assert not lost["available"]
            assert lost["unavailable_reason"] == "no link to the vehicle"
            wait_until(lambda: get(client, "hosts")[0]["available"], limit_s=60)
            wait_until(lambda: flying_with("h1", "h2", "h3"), limit_s=60)
            (first_up, up_again), (lost_at,) = told("LinkUp"), told("LinkLost")
            assert first_up < lost_at < up_again
            wait_until(lambda: told("OrderAccepted")[-1] > up_again)
