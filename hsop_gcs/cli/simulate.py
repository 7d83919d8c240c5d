"""``hsop-gcs simulate``: simulated vehicles on loopback UDP."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import urlsplit

import typer

from hsop_gcs.cli.options import within
from hsop_gcs.errors import BadInput
from hsop_gcs.simulator.faults import FORM, MEANING, parse_fault

if TYPE_CHECKING:
    from collections.abc import Callable

    from hsop_gcs.geometry.frames import GeodeticPoint
    from hsop_gcs.simulator.fleet import SimulatedFleet
    from hsop_gcs.simulator.lookout import Lookout

_FAULT_HELP = (
    f"A fault, repeatable: {FORM}. VEHICLE: h2 or 2; without it, all. START, LENGTH: simulated seconds. "
    + "; ".join(f"{kind}: {meaning}" for kind, meaning in MEANING.items())
    + ". Such as h2:reject=DO_REPOSITION,count=2 or link-cut@30+10."
)


def register(app: typer.Typer) -> None:
    @app.command()
    def simulate(
        vehicles: Annotated[int, typer.Option(help="How many.")] = 1,
        autopilot: Annotated[str, typer.Option(help="px4 or ardupilot.")] = "px4",
        origin: Annotated[
            str, typer.Option(help="Home of the first: LAT,LON,ALTITUDE_AMSL.")
        ] = "-35.363261,149.165230,584",
        position: Annotated[
            list[str] | None, typer.Option(help="EAST,NORTH of a home from the origin, metres; once per vehicle.")
        ] = None,
        spacing_m: Annotated[float, typer.Option(help="Between homes in the grid, without --position.")] = 10.0,
        target: Annotated[
            str, typer.Option(help="HOST:PORT of the first vehicle's peer; the next one's port is one up.")
        ] = ("127.0.0.1:14540"),
        shared_port: Annotated[bool, typer.Option("--shared-port", help="All vehicles send to the same port.")] = False,
        bind: Annotated[str, typer.Option(help="Address on which the vehicles listen.")] = "127.0.0.1",
        local_port: Annotated[int, typer.Option(help="Port of the first vehicle; 0: any free ones.")] = 14580,
        airborne: Annotated[
            float, typer.Option(help="Start armed and hovering at this height, metres; 0: landed.")
        ] = 0.0,
        speed_mps: Annotated[float, typer.Option(help="Cruise speed.")] = 8.0,
        ready_after_s: Annotated[float, typer.Option(help="Until the estimator has a position.")] = 2.0,
        speed: Annotated[float, typer.Option(help="Simulated seconds per second.")] = 1.0,
        loss: Annotated[float, typer.Option(help="Share of datagrams lost, each way.")] = 0.0,
        delay_ms: Annotated[float, typer.Option(help="Delay of datagrams, each way.")] = 0.0,
        jitter_ms: Annotated[float, typer.Option(help="The delay is this much more or less, uniformly.")] = 0.0,
        duplication: Annotated[float, typer.Option(help="Share of datagrams that come twice.")] = 0.0,
        reordering: Annotated[float, typer.Option(help="Share of datagrams held back behind later ones.")] = 0.0,
        wind: Annotated[
            str, typer.Option(help="SPEED,FROM_DEG,GUST: m/s, compass, standard deviation of gusts in m/s.")
        ] = "0,0,0",
        gps_offset: Annotated[str, typer.Option(help="EAST,NORTH,UP of every position fix, metres.")] = "0,0,0",
        gps_noise_m: Annotated[float, typer.Option(help="Standard deviation of a slow error of fixes, metres.")] = 0.0,
        battery: Annotated[float, typer.Option(help="Charge at the start, percent.")] = 100.0,
        endurance_min: Annotated[float, typer.Option(help="Flight time on a full battery.")] = 25.0,
        gimbal_rate_dps: Annotated[float, typer.Option(help="How fast a gimbal turns, degrees a second.")] = 120.0,
        fault: Annotated[list[str] | None, typer.Option(help=_FAULT_HELP)] = None,
        signing_key: Annotated[
            Path | None, typer.Option(help="Key file: vehicles sign, and believe only what is signed.")
        ] = None,
        seed: Annotated[int, typer.Option(help="Of gusts, noise, wandering, losses and the noise on images.")] = 0,
        truth: Annotated[
            str | None,
            typer.Option(
                help="File with the true threats (JSON) for the vehicles' cameras to see; -: a line of it on standard"
                " input, whenever it comes. See --detections-to."
            ),
        ] = None,
        detections_to: Annotated[
            str | None, typer.Option(help="Service to post detections to, such as http://127.0.0.1:8080.")
        ] = None,
        detection_rate: Annotated[float, typer.Option(help="Images per second of every camera.")] = 5.0,
        detection_latency_ms: Annotated[float, typer.Option(help="From exposure to post.")] = 100.0,
        host_id: Annotated[
            list[str] | None,
            typer.Option(help="The service's name of a vehicle, once per vehicle; without: h1, h2, ..."),
        ] = None,
        fleet_config: Annotated[
            Path | None,
            typer.Option("--config", help="FLEET.toml: the vehicles carry the rigs that it gives its hosts."),
        ] = None,
        exit_with_stdin: Annotated[
            bool, typer.Option("--exit-with-stdin", help="End when standard input is closed.")
        ] = False,
    ) -> None:
        """Fly simulated PX4 or ArduPilot vehicles that any MAVLink ground station can talk to over UDP.

        With --truth and --detections-to they also see: each carries the rig of the letter's Table 1, or that of
        --config, and what its cameras detect is posted. True threats fly on the clock of the wall, whatever --speed.
        """
        import asyncio
        import time

        from hsop_gcs.link.key_files import read_key
        from hsop_gcs.simulator.battery import BatteryConfig
        from hsop_gcs.simulator.channel import Impairment
        from hsop_gcs.simulator.disturbances import GpsError, Wind
        from hsop_gcs.simulator.fleet import Autopilot, FleetConfig, SimulatedFleet, grid, places
        from hsop_gcs.simulator.flight import FlightLimits
        from hsop_gcs.simulator.gimbal import GimbalLimits

        if autopilot not in list(Autopilot):
            raise BadInput("--autopilot", f"{autopilot!r} is neither px4 nor ardupilot")
        within("--vehicles", vehicles, 1, 250)
        within("--spacing-m", spacing_m, 0, 10_000)
        within("--airborne", airborne, 0, 10_000)
        within("--speed-mps", speed_mps, 0.1, 50)
        within("--ready-after-s", ready_after_s, 0, 3600)
        within("--speed", speed, 0.01, 100)
        within("--loss", loss, 0, 1)
        within("--delay-ms", delay_ms, 0, 60_000)
        within("--jitter-ms", jitter_ms, 0, delay_ms)
        within("--duplication", duplication, 0, 1)
        within("--reordering", reordering, 0, 1)
        wind_mps, wind_from_deg, gust_mps = _numbers("--wind", wind, "SPEED,FROM_DEG,GUST")
        within("--wind", wind_mps, 0, 50)
        within("--wind", wind_from_deg, 0, 360)
        within("--wind", gust_mps, 0, 20)
        offset_east_m, offset_north_m, offset_up_m = _numbers("--gps-offset", gps_offset, "EAST,NORTH,UP")
        within("--gps-noise-m", gps_noise_m, 0, 100)
        within("--battery", battery, 1, 100)
        within("--endurance-min", endurance_min, 0.1, 10_000)
        within("--gimbal-rate-dps", gimbal_rate_dps, 1, 10_000)
        within("--seed", seed, 0, 2**63)
        within("--local-port", local_port, 0, 65536 - vehicles)
        home = _origin(origin)
        if position and len(position) != vehicles:
            raise BadInput("--position", f"{len(position)} given for {vehicles} vehicles")
        if (truth is None) != (detections_to is None):
            missing, given = ("--truth", "--detections-to") if truth is None else ("--detections-to", "--truth")
            raise BadInput(missing, f"needed with {given}")
        if host_id and len(set(host_id)) != vehicles:
            raise BadInput("--host-id", f"{len(set(host_id))} different ones given for {vehicles} vehicles")
        within("--detection-rate", detection_rate, 0.1, 50)
        within("--detection-latency-ms", detection_latency_ms, 0, 60_000)
        config = FleetConfig(
            autopilot=Autopilot(autopilot),
            homes=places(home, [_pair(text) for text in position]) if position else grid(home, vehicles, spacing_m),
            target=_target(target, 1 if shared_port else vehicles),
            shared_port=shared_port,
            bind=bind,
            local_port=local_port,
            airborne_m=airborne,
            ready_after_s=ready_after_s,
            flight=FlightLimits(cruise_mps=speed_mps, max_speed_mps=max(15.0, speed_mps)),
            gimbal=GimbalLimits(slew_rad_s=math.radians(gimbal_rate_dps)),
            battery=BatteryConfig(endurance_s=endurance_min * 60, percent=battery),
            wind=Wind(speed_mps=wind_mps, from_deg=wind_from_deg, gust_mps=gust_mps),
            gps=GpsError(offset_m=(offset_east_m, offset_north_m, offset_up_m), noise_m=gps_noise_m),
            faults=[parse_fault(text, vehicles) for text in fault or ()],
            impairment=Impairment(
                loss=loss,
                duplication=duplication,
                reordering=reordering,
                delay_s=delay_ms * 1e-3,
                jitter_s=jitter_ms * 1e-3,
            ),
            signing_key=None if signing_key is None else read_key(signing_key),
            seed=seed,
            speed=speed,
        )
        fleet = SimulatedFleet(config, clock=time.monotonic)
        lookout = None
        if truth is not None and detections_to is not None:
            from hsop_gcs.clocks import RisingClock
            from hsop_gcs.geometry.frames import LocalFrame
            from hsop_gcs.settings import read_settings
            from hsop_gcs.simulator.lookout import Lookout, LookoutConfig
            from hsop_gcs.simulator.truth import read_truth, truth_from_text

            config_of_eyes = LookoutConfig(
                service=_service(detections_to),
                host_ids=host_id or [f"h{number}" for number in range(1, vehicles + 1)],
                rigs={} if fleet_config is None else read_settings(fleet_config).to_fleet().rigs(),
                rate_hz=detection_rate,
                latency_s=detection_latency_ms * 1e-3,
                give_up_s=detection_latency_ms * 1e-3 + 2.0,
                seed=seed,
            )
            in_file = None if truth == "-" else read_truth(Path(truth), home)

            def lookout(line: str) -> Lookout:
                seen = in_file or truth_from_text(line, home)
                return Lookout(fleet, seen, LocalFrame(home), config_of_eyes, clock=RisingClock())

        asyncio.run(_run(fleet, lookout, truth_on_stdin=truth == "-", exit_with_stdin=exit_with_stdin))


async def _run(
    fleet: "SimulatedFleet",
    lookout_of: "Callable[[str], Lookout] | None",
    *,
    truth_on_stdin: bool,
    exit_with_stdin: bool,
) -> None:
    """Fly until a signal, or the end of standard input if asked for, or a fault."""
    import asyncio
    import threading
    from datetime import UTC, datetime

    from hsop_gcs.workers import stop_on_signals

    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    stop_on_signals(stop.set, patience_s=10.0)
    lines: asyncio.Queue[str] = asyncio.Queue()
    lookout: Lookout | None = None

    def read_stdin() -> None:
        # Unbuffered: a buffer's lock, held by a thread that waits for input, would abort the interpreter's exit.
        with open(0, "rb", buffering=0, closefd=False) as stdin:
            for line in stdin:
                loop.call_soon_threadsafe(lines.put_nowait, line.decode(errors="replace"))
        if exit_with_stdin:
            loop.call_soon_threadsafe(stop.set)
        else:
            loop.call_soon_threadsafe(lines.put_nowait, "")

    async def look(lookout_of: "Callable[[str], Lookout]") -> None:
        nonlocal lookout
        lookout = lookout_of(await lines.get() if truth_on_stdin else "")
        typer.echo(f"truth: from {datetime.fromtimestamp(lookout.epoch_s, UTC).isoformat()}")
        await lookout.run()

    await fleet.start()
    try:
        if truth_on_stdin or exit_with_stdin:
            threading.Thread(target=read_stdin, daemon=True).start()
        for vehicle, local, target in zip(fleet.vehicles, fleet.local_addresses, fleet.targets, strict=True):
            typer.echo(f"system {vehicle.config.system}: {local[0]}:{local[1]} -> {target[0]}:{target[1]}")
        waiting = {asyncio.create_task(stop.wait()), asyncio.create_task(fleet.failed())}
        if lookout_of is not None:
            waiting.add(asyncio.create_task(look(lookout_of)))
        done, pending = await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        for task in pending:
            task.cancel()
        await asyncio.gather(*pending, return_exceptions=True)
        for task in done:
            task.result()
    finally:
        await fleet.close()
        if fleet.lost:
            typer.echo(f"link: {fleet.lost} datagrams not carried")
        if fleet.refused:
            told = ", ".join(f"{count} {what}" for what, count in fleet.refused.items())
            typer.echo(f"signatures refused: {told}")
        if lookout is not None:
            typer.echo(str(lookout.tally))


def _numbers(name: str, text: str, form: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not all(map(math.isfinite, numbers)):
        raise BadInput(name, f"{text!r} is not {form}")
    return numbers


def _origin(text: str) -> "GeodeticPoint":
    from hsop_gcs.geometry.frames import GeodeticPoint

    lat_deg, lon_deg, altitude_m = _numbers("--origin", text, "LAT,LON,ALTITUDE_AMSL")
    if abs(lat_deg) >= 90:
        raise BadInput("--origin", f"latitude {lat_deg} of {text!r} is not between -90 and 90")
    if abs(lon_deg) > 180:
        raise BadInput("--origin", f"longitude {lon_deg} of {text!r} is not between -180 and 180")
    if not -500 <= altitude_m <= 10_000:
        raise BadInput("--origin", f"altitude {altitude_m} of {text!r} is not between -500 and 10000 m")
    return GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=altitude_m)


def _pair(text: str) -> tuple[float, float]:
    east, north = _numbers("--position", text, "EAST,NORTH")
    if math.hypot(east, north) > 100_000:
        raise BadInput("--position", f"{text!r} is more than 100 km from the origin")
    return east, north


def _target(text: str, ports: int) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not host or not port.isdecimal() or not 1 <= int(port) <= 65536 - ports:
        raise BadInput("--target", f"{text!r} is not HOST:PORT with room for {ports} ports")
    return host, int(port)


def _service(text: str) -> str:
    parts = urlsplit(text)
    if parts.scheme not in ("http", "https") or not parts.hostname or parts.path not in ("", "/"):
        raise BadInput("--detections-to", f"{text!r} is not http://HOST:PORT")
    return text
