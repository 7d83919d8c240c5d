"""The composition root: settings become objects, which start and stop in order."""

import asyncio
import gc
import logging
import signal
import socket
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

from hsop_gcs.api import create_api
from hsop_gcs.api.bounds import Account, Bounds
from hsop_gcs.api.front import Front
from hsop_gcs.api.placements import WhatIf
from hsop_gcs.api.server import serving
from hsop_gcs.clocks import Clock, RisingClock, boot_id, steady_s
from hsop_gcs.disk import DiskWatch
from hsop_gcs.errors import Unavailable
from hsop_gcs.geometry import triangulation
from hsop_gcs.link.codec import message_ids
from hsop_gcs.link.endpoint import parse_pin
from hsop_gcs.link.faults import describe
from hsop_gcs.link.guest_port import GuestPort
from hsop_gcs.link.key_files import TimestampFile, read_key
from hsop_gcs.link.pump import Link
from hsop_gcs.link.signing import Signing, SigningClock
from hsop_gcs.link.tlog import TlogWriter, open_tlog
from hsop_gcs.mission.clock import MissionClock
from hsop_gcs.mission.controller import Mission
from hsop_gcs.mission.recovery import resumed
from hsop_gcs.mission.solver import Solver
from hsop_gcs.settings import Settings
from hsop_gcs.tracks import track_kernels
from hsop_gcs.workers import in_thread, stop_on_signals

_WATCHDOG_S = 3.0
"""A mission that has not moved for so long is dead: our heartbeat stops, and the vehicles' own failsafes act."""
_LONGEST_STOP_S = 20.0

log = logging.getLogger(__name__)


@asynccontextmanager
async def running_mission(settings: Settings) -> AsyncIterator[Mission]:
    """Open journal, link and solver and keep the mission moving; everything is closed on the way out."""
    fleet = settings.to_fleet()
    async with AsyncExitStack() as stack:
        solver = await stack.enter_async_context(Solver())
        journal, recovered = None, None
        if settings.service.journal is not None:
            path = Path(settings.service.journal)
            # in a thread: reading a long journal would stop the loop for seconds
            keep_bytes = settings.service.journal_keep_bytes
            journal, recovered = await in_thread(lambda: stack.enter_context(resumed(path, keep_bytes=keep_bytes)))
            if journal.bytes_cut:
                log.warning("journal %s: its last line was torn; %d bytes were cut off", path, journal.bytes_cut)
        tlog, rising = None, RisingClock()
        if settings.service.tlog is not None:
            tlog = stack.enter_context(open_tlog(Path(settings.service.tlog), rising))
        disk = None
        folders = _written_to(settings)
        if folders and settings.service.disk_reserve_bytes:
            disk = stack.enter_context(DiskWatch(folders, settings.service.disk_reserve_bytes))
        link = await stack.enter_async_context(link_of(settings, tlog=tlog, watchdog_s=_WATCHDOG_S, rising=rising))
        for host in settings.hosts:
            if host.mavsdk_port is not None:
                await stack.enter_async_context(GuestPort(link, host.system_id, host.mavsdk_port))
        mission = Mission(
            fleet=fleet,
            site=settings.to_site(),
            link=link,
            solver=solver,
            clock=MissionClock(time.time, steady_s, before=recovered.timeline if recovered else None, boot=boot_id()),
            rules=settings.to_rules(),
            recovered=recovered,
            journal=journal,
            tlog=tlog,
            disk=disk,
            tracker_ready=False,
        )
        async with _moving(mission):
            yield mission


@asynccontextmanager
async def _moving(mission: Mission) -> AsyncIterator[None]:
    """Keep the mission moving. Raises Unavailable as soon as it or its link ends by itself: then nothing is served."""
    served = asyncio.current_task()
    failed: list[BaseException] = []

    def note(task: asyncio.Task[None]) -> None:
        error = None if task.cancelled() else task.exception()
        if error is not None:
            log.critical("the service ends", exc_info=error)
            failed.append(error)
            if served is not None:
                served.cancel()

    tasks = [asyncio.create_task(mission.run()), asyncio.create_task(mission.link.wait_ended())]
    for task in tasks:
        task.add_done_callback(note)
    try:
        yield
    except asyncio.CancelledError:
        if not failed or served is None:
            raise
        served.uncancel()
        raise Unavailable(f"the service has ended: {describe(failed[0])}") from failed[0]
    finally:
        for task in tasks:
            task.remove_done_callback(note)
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _written_to(settings: Settings) -> list[Path]:
    """The folders that the service goes on writing to, one of each disk."""
    journal, tlog = settings.service.journal, settings.service.tlog
    folders = [*([Path(journal).parent] if journal else []), *([Path(tlog)] if tlog else [])]
    disks: dict[object, Path] = {}
    for folder in folders:
        disks.setdefault(folder.stat().st_dev if folder.is_dir() else folder, folder)
    return list(disks.values())


async def load_tracker(mission: Mission) -> None:
    """Load the tracker's kernels, or compile them the first time on a machine; from then on reports are taken."""
    await in_thread(track_kernels.warm_up)
    await in_thread(triangulation.warm_up)
    mission.tracker_ready = True


def link_of(
    settings: Settings,
    *,
    tlog: TlogWriter | None = None,
    watchdog_s: float | None = None,
    rising: Clock | None = None,
) -> Link:
    """Return the link to the fleet, not open yet. rising: UTC that never goes back, for stamps."""
    rising = rising or RisingClock()
    connections = {host.system_id: host.connection for host in settings.hosts}
    return Link(
        sorted(set(connections.values())),
        connections,
        connections=connections,
        clock=steady_s,
        signing=_signing(settings, rising),
        pins={host.system_id: parse_pin(host.address) for host in settings.hosts if host.address is not None},
        on_frame=_recorder(tlog, rising),
        watchdog_s=watchdog_s,
    )


def _signing(settings: Settings, rising: Clock) -> dict[str, Signing]:
    """Return how each signed connection signs. Raises Unavailable if timestamps could not be kept over a restart."""
    files, wanted = settings.key_files(), settings.signing
    if not files:
        return {}
    kept = wanted.timestamp_file or f"{next(iter(files.values()))}.timestamp"
    store = TimestampFile(Path(kept))
    clock = SigningClock(time.time, rising=rising, saved=store.load(), save=store.save)
    clock.next()
    if clock.problem is not None:
        raise Unavailable(f"{clock.problem}: {kept}")
    allowed = message_ids(wanted.allow_unsigned)
    return {
        connection: Signing(
            read_key(file), clock=clock, link_id=(wanted.link_id + number) % 256, allow_unsigned=allowed
        )
        for number, (connection, file) in enumerate(files.items())
    }


def _recorder(tlog: TlogWriter | None, rising: Clock) -> Callable[[bytes], None] | None:
    return None if tlog is None else lambda raw: tlog.write(rising(), raw)


@asynccontextmanager
async def running_service(settings: Settings) -> AsyncIterator[str]:
    """Run mission and API; yields the API's base address once reports are taken. Raises Unavailable if its port cannot
    be had. The port answers from the beginning, and tells what is awaited.
    """
    front = Front()
    with _listen(settings.service.host, settings.service.port) as listening:
        host, port = listening.getsockname()[:2]
        address = f"http://{host}:{port}"
        bounds, account = _bounds(settings), Account()
        async with (
            serving(front, listening, bounds, account),
            running_mission(settings) as mission,
            WhatIf() as what_if,
        ):
            front.open(create_api(mission, what_if, bounds, account))
            await load_tracker(mission)
            yield address


def _bounds(settings: Settings) -> Bounds:
    given = settings.service
    return Bounds(
        connections=given.max_connections,
        connections_per_address=given.max_connections_per_address,
        requests_per_s=given.max_requests_per_s,
        body_bytes=given.max_body_bytes,
    )


async def serve(settings: Settings, on_ready: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM; ``on_ready`` is given the base address."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    stop_on_signals(stop.set, patience_s=_LONGEST_STOP_S)
    loop.add_signal_handler(signal.SIGHUP, log.warning, "SIGHUP: the settings are read at the start only; still flying")
    async with running_service(settings) as address:
        # what is there now stays to the end: no collection of garbage needs to go through it again
        gc.collect()
        gc.freeze()
        on_ready(address)
        await stop.wait()


def _listen(host: str, port: int) -> socket.socket:
    try:
        listening = socket.create_server((host, port))
    except OSError as error:
        raise Unavailable(f"cannot listen on {host}:{port}: {error.strerror}") from None
    # asyncio sets this itself only on sockets that say they are TCP; without it every answer waits 40 ms
    listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listening
