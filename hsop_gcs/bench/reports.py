"""What ``hsop-gcs bench reports`` measures: a real service with a journal, and radars that report over HTTP.

Load: many threats, each reported at the same rate, all of a scan in one request or each report in its own, with the
source's ids and without. The whole way counts, from the socket to the picture, in processor time of the service's own
process. Picture: from the request that reports a threat to an answer of ``GET /api/v1/threats`` that shows it, with
nothing else to do. No host is heard, so that nothing is flown.
"""

import http.client
import json
import math
import tempfile
import time
import urllib.parse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from hsop_gcs.bench.console import Threat
from hsop_gcs.bench.link import Spread, Step, spread
from hsop_gcs.bench.process import Service, running
from hsop_gcs.errors import Unavailable
from hsop_gcs.loopback import ORIGIN

_REACH_M = 500.0
_MAX_SPEED_MPS = 10.0
_TIMEOUT_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """What reports at a steady rate take."""

    one_by_one: bool
    """A request for every report, one after the other; else one for each scan of all threats."""
    ids: bool
    reports_per_s: float
    """What was sent; less than asked for where the client or the service could not keep up."""
    tracks: int
    """In the picture at the end."""
    service_cores: float
    """Processor seconds of the service's process per second."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What was measured."""

    threats: int
    rate_hz: float
    idle_cores: float
    """What the service takes with nothing to do."""
    loads: tuple[Load, ...]
    new_in_picture: Spread | None
    """From the request that reports an unknown threat to the end of an answer that shows it."""
    known_in_picture: Spread | None
    """The same for a report that corrects a threat in the picture."""

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


def measure(*, threats: int, rate_hz: float, duration_s: float, reports: int, seed: int, step: Step) -> Result:
    """Run each load for so long, then so many single reports. Raises Unavailable if the service fails."""
    rng = np.random.default_rng(seed)
    step("starting the service")
    with _service() as (service, client):
        step("idle")
        idle_cores = _cores(service, lambda: time.sleep(duration_s))
        loads = []
        for ids in (True, False):
            for one_by_one in (False, True):
                step(f"{threats} threats, {'one by one' if one_by_one else 'in scans'}, {'with' if ids else 'no'} ids")
                radar = _Radar(client, [_threat(f"t{number}", rng) for number in range(threats)], ids, one_by_one)
                loads.append(_load(service, radar, rate_hz, duration_s))
                client.clear()
        step(f"{reports} single reports")
        new_s, known_s = _to_picture(client, reports, rng)
    return Result(
        threats=threats,
        rate_hz=rate_hz,
        idle_cores=idle_cores,
        loads=tuple(loads),
        new_in_picture=spread(new_s) if reports else None,
        known_in_picture=spread(known_s) if reports else None,
    )


class _Client:
    """One connection that stays open. The standard library's: it must not be busier than the service."""

    def __init__(self, address: str) -> None:
        self._connection = http.client.HTTPConnection(urllib.parse.urlsplit(address).netloc, timeout=_TIMEOUT_S)

    def ask(self, method: str, path: str, body: Any = None) -> Any:
        """Return the answer's JSON. Raises Unavailable for an error."""
        text = None if body is None else json.dumps(body)
        self._connection.request(method, f"/api/v1/{path}", text, {"Content-Type": "application/json"})
        answer = self._connection.getresponse()
        content = answer.read()
        if answer.status >= 400:
            raise Unavailable(f"{method} {path}: {content.decode()[:300]}")
        return json.loads(content) if content else None

    def clear(self) -> None:
        """Dismiss every threat."""
        for threat in self.ask("GET", "threats"):
            self.ask("DELETE", f"threats/{threat['id']}")

    def close(self) -> None:
        self._connection.close()


class _Radar:
    """Reports threats on straight ways."""

    def __init__(self, client: _Client, threats: Sequence[Threat], ids: bool, one_by_one: bool) -> None:
        self.ids = ids
        self.one_by_one = one_by_one
        self.sent = 0
        self._client = client
        self._threats = threats
        self._since_s = time.time()
        # each its own source: the ids of threats that were dismissed are refused for a while
        self._source = f"radar-{'ids' if ids else 'plots'}-{'one' if one_by_one else 'scans'}"

    def scan(self) -> None:
        """Report every threat where it is now."""
        now_s = time.time()
        found = [{**each.report(self._since_s, now_s), "source": self._source} for each in self._threats]
        if not self.ids:
            found = [{name: value for name, value in each.items() if name != "threat_id"} for each in found]
        for body in found if self.one_by_one else [found]:
            self._client.ask("POST", "reports", body)
        self.sent += len(found)

    def run(self, rate_hz: float, for_s: float) -> None:
        """Scan at a steady rate for so long; a scan that could not be begun in its time is left out."""
        began, done = time.monotonic(), 0
        while (elapsed_s := time.monotonic() - began) < for_s:
            if elapsed_s * rate_hz >= done:
                self.scan()
                done = math.floor(elapsed_s * rate_hz) + 1
            time.sleep(max(0.0, began + done / rate_hz - time.monotonic()))

    def tracks(self) -> int:
        return len(self._client.ask("GET", "threats"))


def _load(service: Service, radar: _Radar, rate_hz: float, duration_s: float) -> Load:
    radar.run(rate_hz, duration_s / 4)
    before, began = radar.sent, time.monotonic()
    cores = _cores(service, lambda: radar.run(rate_hz, duration_s))
    return Load(
        one_by_one=radar.one_by_one,
        ids=radar.ids,
        reports_per_s=(radar.sent - before) / (time.monotonic() - began),
        tracks=radar.tracks(),
        service_cores=cores,
    )


def _cores(service: Service, work: Callable[[], None]) -> float:
    before = service.usage()
    work()
    after = service.usage()
    return (after.own_cpu_s - before.own_cpu_s) / (after.time_s - before.time_s)


def _to_picture(client: _Client, reports: int, rng: np.random.Generator) -> tuple[list[float], list[float]]:
    new_s: list[float] = []
    known_s: list[float] = []
    for number in range(reports):
        threat = _threat(f"single-{number}", rng)
        for seconds in (new_s, known_s):
            # not a whole number of the mission's ticks: reports shall come at any moment of them
            time.sleep(float(rng.uniform(0.1, 0.4)))
            seconds.append(_seconds_to_picture(client, threat))
        client.clear()
    return new_s, known_s


def _seconds_to_picture(client: _Client, threat: Threat) -> float:
    wall_s = time.time()
    body = threat.report(wall_s, wall_s)
    began = time.perf_counter()
    client.ask("POST", "reports", body)
    while not _is_shown(client.ask("GET", "threats"), threat.name, wall_s):
        pass
    return time.perf_counter() - began


def _is_shown(picture: Sequence[dict[str, Any]], name: str, time_s: float) -> bool:
    times_s = [datetime.fromisoformat(each["time"]).timestamp() for each in picture if each["id"] == name]
    return any(abs(shown_s - time_s) < 1e-3 for shown_s in times_s)


def _threat(name: str, rng: np.random.Generator) -> Threat:
    east, north = rng.uniform(-_REACH_M, _REACH_M, 2).tolist()
    course, speed_mps = rng.uniform(0, 2 * math.pi), rng.uniform(1, _MAX_SPEED_MPS)
    velocity_mps = (float(speed_mps * math.sin(course)), float(speed_mps * math.cos(course)))
    return Threat(name=name, position_m=(east, north), velocity_mps=velocity_mps)


@contextmanager
def _service() -> Iterator[tuple[Service, _Client]]:
    with tempfile.TemporaryDirectory(prefix="hsop-gcs-bench-") as folder:
        config = Path(folder, "fleet.toml")
        config.write_text(
            "[site]\n"
            f"origin = {{ lat_deg = {ORIGIN.lat_deg}, lon_deg = {ORIGIN.lon_deg},"
            f" altitude_amsl_m = {ORIGIN.altitude_amsl_m} }}\n"
            f'[service]\nautonomy = "advise"\nmax_requests_per_s = 1e6\njournal = "{Path(folder, "mission.journal")}"\n'
            "[tracks]\nmax_tracks = 1000\n"
            '[[hosts]]\nid = "h1"\nsystem_id = 1\nconnection = "udpin:127.0.0.1:0"\n'
        )
        with running(config, Path(folder, "service.log")) as service:
            client = _Client(service.address)
            try:
                yield service, client
            finally:
                client.close()
