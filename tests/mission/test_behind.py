"""A service that gets too little processor time does not take its own lateness for that of its hosts."""

from hsop_gcs.assignment import HostOrder
from hsop_gcs.mission.inputs import HostDeparted, HostStopped, Rules
from hsop_gcs.mission.notices import ServiceBehind, ServiceCaughtUp
from hsop_gcs.mission.planning import Decision, PlanningRules, Situation
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.placement.solution import Placement, Status
from hsop_gcs.simulator.truth import TrueState
from tests.mission.headless import EPOCH_S, Flight, Moment, fly, straight

ONE = straight([TrueState(id="t1", position_m=(0.0, 200.0, 35.0), velocity_mps=(0.0, 0.0, 0.0), size_m=1.0)])
FROM_S, UNTIL_S = 10.0, 26.0
LATE_S = 2.8
"""More than the age at which a position counts as not known."""


def far_away(asked: Situation, rules: PlanningRules) -> Decision:
    """Every host goes 90 m to the south, side by side."""
    orders = tuple(
        HostOrder(host=mover.id, position_m=(12.0 * number, -90.0, 30.0), heading_deg=0.0, aim=None, views=())
        for number, mover in enumerate(asked.movers)
    )
    placement = Placement(status=Status.FEASIBLE, formulation=rules.formulation, objective=rules.objective)
    return Decision(placement=placement, threats=asked.threats, window_start_s=asked.now_s + 30.0, orders=orders)


def test_hosts_fly_on_while_the_service_is_behind_and_none_departs() -> None:
    starved: list[float] = []

    def watch(moment: Moment) -> None:
        link = moment.mission.link
        if starved or moment.time_s < FROM_S:
            return
        turn, starved[:] = link._turn, [link.now()]

        def seldom() -> None:
            if link.now() >= starved[-1] + LATE_S or link.now() > UNTIL_S:
                starved.append(link.now())
                turn()

        link._turn = seldom  # type: ignore[method-assign]

    flight = Flight(truth=ONE, hosts=2, duration_s=UNTIL_S + 6.0, rules=Rules(autonomy=Autonomy.AUTO))
    mission = fly(flight, watch, far_away)
    happened = [each.event for each in mission.events]
    assert len([event for event in happened if isinstance(event, HostDeparted)]) >= 2
    assert not [event for event in happened if isinstance(event, HostStopped)]
    (behind,) = [each for each in mission.events if isinstance(each.event, ServiceBehind)]
    (caught_up,) = [each for each in mission.events if isinstance(each.event, ServiceCaughtUp)]
    assert behind.time_s < EPOCH_S + FROM_S + 2 * LATE_S
    assert caught_up.time_s > EPOCH_S + UNTIL_S
    assert not [
        each
        for each in mission.events
        if isinstance(each.event, HostDeparted) and behind.time_s < each.time_s < caught_up.time_s
    ]
