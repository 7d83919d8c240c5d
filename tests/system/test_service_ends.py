"""A service whose link or mission has ended by itself ends, and says so: nothing is answered that cannot be done."""

import asyncio
from collections.abc import Callable

import pytest

from hsop_gcs.app import running_mission
from hsop_gcs.errors import Unavailable
from hsop_gcs.link.events import LinkUp
from hsop_gcs.settings import Settings
from tests.service import ORIGIN

HOST = {"id": "h1", "system_id": 1, "connection": "udpin:127.0.0.1:0"}


def explode(*_: object) -> None:
    raise RuntimeError("thrown in by a test")


@pytest.mark.parametrize("what", ["the pump", "the mission"])
def test_a_service_whose_link_or_mission_has_ended_ends_with_the_reason(what: str) -> None:
    async def serve() -> None:
        settings = Settings.model_validate({"site": {"origin": ORIGIN}, "hosts": [HOST]})
        async with running_mission(settings) as mission:
            if what == "the pump":
                mission.link._turn = explode  # type: ignore[method-assign]
            else:
                mission._round = explode  # type: ignore[assignment, method-assign]
            await asyncio.sleep(60.0)

    with pytest.raises(Unavailable, match="thrown in by a test"):
        asyncio.run(serve())


def test_no_wish_is_said_to_be_granted_while_nothing_can_be_sent() -> None:
    async def serve() -> None:
        settings = Settings.model_validate({"site": {"origin": ORIGIN}, "hosts": [HOST]})
        async with running_mission(settings) as mission:
            link, pump = mission.link, mission.link._pump
            link._pump = None
            try:
                for wish in (mission.hold, mission.recall, mission.release):
                    with pytest.raises(Unavailable, match="nothing can be sent"):
                        wish()
                with pytest.raises(Unavailable, match="nothing can be sent"):
                    mission.take_off(20.0)
                assert not mission.state.held
            finally:
                link._pump = pump

    asyncio.run(serve())


def test_a_round_that_fails_is_tried_again_and_the_heartbeat_stands_for_it() -> None:
    async def serve() -> None:
        settings = Settings.model_validate({"site": {"origin": ORIGIN}, "hosts": [HOST]})
        async with running_mission(settings) as mission:
            fed: list[bool] = []
            mission.link.keep_alive = lambda: fed.append(True)  # type: ignore[method-assign]
            mission.tracker_ready = True
            direct_traffic = mission._direct_traffic
            setattr(mission, "_direct_traffic", explode)  # noqa: B010 - it takes what it is given
            await _until(lambda: bool(mission.faults))
            fed.clear()
            await asyncio.sleep(0.5)
            assert not fed
            assert mission.faults == {"the supervision of flights": "RuntimeError: thrown in by a test"}
            mission._direct_traffic = direct_traffic  # type: ignore[method-assign]
            await _until(lambda: bool(fed) and not mission.faults)
            for part in ("_keep_time", "_tend_storage", "_age", "_fly_unasked", "_follow_threats", "_plan_if_due"):
                before = getattr(mission, part)
                setattr(mission, part, explode)
                await _until(lambda: bool(mission.faults))
                fed.clear()
                await _until(lambda: bool(fed))
                setattr(mission, part, before)
                await _until(lambda: not mission.faults)

    asyncio.run(serve())


async def _until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(30.0):
        while not condition():
            await asyncio.sleep(0.02)


def test_an_event_that_the_mission_fails_at_costs_itself() -> None:
    async def serve() -> None:
        settings = Settings.model_validate({"site": {"origin": ORIGIN}, "hosts": [HOST]})
        async with running_mission(settings) as mission:
            mission.link.events.put_nowait(LinkUp(system=77))
            mission.link.events.put_nowait(LinkUp(system=1))
            await _until(lambda: [each.event for each in mission.events] == [LinkUp(system=1)])
            assert mission.fault_counts == {"taking a LinkUp": 1}

    asyncio.run(serve())
