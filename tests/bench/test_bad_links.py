"""Plans over terrible links, many times; and once with the service and everything real.

pytest tests/bench --override-ini addopts=
"""

import sys
import time
from collections import Counter
from typing import Any

import pytest

from tests.link.test_link_bad_links import check_two_plans
from tests.service import free_udp_port, report, service, settings, simulated_fleet, wait_until

HOSTS = 6


@pytest.mark.parametrize("seed", range(1, 21))
def test_two_plans_are_carried_out_once_and_in_order_over_terrible_links(seed: int) -> None:
    check_two_plans(seed)


@pytest.mark.timeout(900)
def test_the_service_flies_six_hosts_over_terrible_links() -> None:
    line = "--loss 0.3 --delay-ms 300 --jitter-ms 200 --duplication 0.05"
    good_s, bad_s = seconds_to_station(), seconds_to_station(*line.split())
    sys.stdout.write(f"on station after {good_s:.0f} s over good links, {bad_s:.0f} s over terrible ones\n")
    assert bad_s <= 3 * good_s


def seconds_to_station(*line: str) -> float:
    """Fly six hosts to stations over such a line; every order is accepted once, none fails."""
    port = free_udp_port()
    wanted = settings(HOSTS, port, autonomy="confirm", hosts=HOSTS, horizon_s=60.0)
    with service(wanted) as client, simulated_fleet(port, HOSTS, "--spacing-m", "20", *line):

        def get(path: str) -> Any:
            return client.get(f"/api/v1/{path}").raise_for_status().json()

        wait_until(lambda: get("health")["planning"]["ready"], limit_s=240)
        wait_until(lambda: get("health")["hosts_available"] == HOSTS, limit_s=120)
        still = {"east_mps": 0.0, "north_mps": 0.0, "up_mps": 0.0}

        def keep_reporting() -> None:
            threats = []
            for number in range(3):
                threat = report(f"t{number}", velocity=still)
                threat["position"]["lon_deg"] += 0.0008 * number
                threats.append(threat)
            client.post("/api/v1/reports", json=threats).raise_for_status()

        def planned() -> dict[str, Any] | None:
            keep_reporting()
            proposed: dict[str, Any] | None = get("plan")["proposed"]
            return proposed if proposed is not None and len(proposed["orders"]) == HOSTS else None

        plan = wait_until(planned, limit_s=120)
        client.post("/api/v1/plan/approve", json={"plan_id": plan["id"]}).raise_for_status()
        approved_s = time.monotonic()

        def on_station() -> bool:
            keep_reporting()
            statuses = [host["order"]["status"] for host in get("hosts")]
            assert "failed" not in statuses, get("events")[-5:]
            return statuses == ["on station"] * HOSTS

        wait_until(on_station, limit_s=120)
        took_s = time.monotonic() - approved_s
        events = get("events")
    accepted = Counter(event["details"]["order_id"] for event in events if event["kind"] == "OrderAccepted")
    assert set(accepted.values()) == {1}
    assert [event for event in events if event["kind"] == "OrderFailed"] == []
    return took_s
