"""Fleet files and start scripts speak of the same vehicles; a fleet file flies."""

import math
from pathlib import Path

import httpx2
import pytest

from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.settings import Settings, read_settings
from tests.service import free_udp_port, service, simulated_fleet, wait_until
from tests.sitl import parameters
from tests.sitl.parameters import CONFIGS
from tests.sitl.starters import alive, refused, requires_shell, started

SIZES = (2, 4, 10)
STACKS = ("px4", "ardupilot")
STOPPING_MPS2 = 3.0
"""Both stacks brake harder than this."""


def fleet(stack: str, size: int) -> Settings:
    return read_settings(CONFIGS / stack / f"fleet-{size}.toml")


def east_north_m(settings: Settings, lat_deg: float, lon_deg: float) -> tuple[float, float]:
    frame = settings.to_site().frame
    point = GeodeticPoint(lat_deg=lat_deg, lon_deg=lon_deg, altitude_amsl_m=frame.origin.altitude_amsl_m)
    east, north, _ = frame.to_enu(point)
    return float(east), float(north)


@pytest.mark.parametrize("stack", STACKS)
@pytest.mark.parametrize("size", SIZES)
def test_a_fleet_file_is_read_and_has_its_hosts(stack: str, size: int) -> None:
    settings = fleet(stack, size)
    assert len(settings.hosts) == size
    assert len({host.connection for host in settings.hosts}) == size, "one port per vehicle"
    assert settings.to_airspace().inside
    assert settings.hosts == fleet(stack, 10).hosts[:size]


def test_fleets_of_both_stacks_can_fly_together() -> None:
    hosts = [host for stack in STACKS for host in fleet(stack, 10).hosts]
    for name in ("id", "system_id", "connection"):
        assert len({getattr(host, name) for host in hosts}) == 20


@requires_shell
@pytest.mark.parametrize(("stack", "script"), [("px4", "start-px4.sh"), ("ardupilot", "start-ardupilot.sh")])
@pytest.mark.parametrize("size", SIZES)
def test_a_starter_starts_the_vehicles_of_its_fleet(stack: str, script: str, size: int, tmp_path: Path) -> None:
    settings = fleet(stack, size)
    with started(script, size, tmp_path) as running:
        told = {vehicle.system_id: f"udpin:127.0.0.1:{vehicle.port}" for vehicle in running.vehicles}
        assert told == {host.system_id: host.connection for host in settings.hosts}
        homes = [east_north_m(settings, vehicle.lat_deg, vehicle.lon_deg) for vehicle in running.vehicles]
    separations = [math.dist(one, other) for at, one in enumerate(homes) for other in homes[:at]]
    assert min(separations) > settings.planning.min_separation_m + 2.0, "take-offs keep their distance in a gust"
    assert all(settings.to_airspace().fence_room_m((*home, 20.0)) > 50.0 for home in homes)


@requires_shell
@pytest.mark.parametrize("stack", STACKS)
def test_the_autopilots_fence_is_wider_than_the_fleets_from_every_home(stack: str, tmp_path: Path) -> None:
    settings = fleet(stack, 10)
    stopping_m = settings.limits.speed_mps**2 / (2 * STOPPING_MPS2)
    if stack == "px4":
        fence = parameters.px4("fence")
        radius_m, ceiling_m = fence["GF_MAX_HOR_DIST"], fence["GF_MAX_VER_DIST"]
    else:
        fence = parameters.ardupilot("fence")
        radius_m, ceiling_m = fence["FENCE_RADIUS"], fence["FENCE_ALT_MAX"]
        stopping_m += fence["FENCE_MARGIN"]
    (corners,) = settings.to_airspace().inside
    with started(f"start-{stack}.sh", 10, tmp_path) as running:
        homes = [east_north_m(settings, vehicle.lat_deg, vehicle.lon_deg) for vehicle in running.vehicles]
    assert max(math.dist(home, corner) for home in homes for corner in corners) + stopping_m < radius_m
    assert settings.limits.ceiling_m + stopping_m < ceiling_m


@requires_shell
def test_px4_gets_its_parameters_home_and_instance(tmp_path: Path) -> None:
    with started("start-px4.sh", 2, tmp_path) as running:
        calls = sorted(running.calls, key=lambda call: call.environment["PX4_HOME_LON"])
    given = {
        name.removeprefix("PX4_PARAM_"): float(value)
        for name, value in calls[1].environment.items()
        if name.startswith("PX4_PARAM_")
    }
    wanted = parameters.px4("failsafe", "fence", "gimbal-sih", "sitl")
    assert given == wanted | {"RTL_RETURN_ALT": wanted["RTL_RETURN_ALT"] + 5}
    assert calls[1].environment["PX4_SIM_MODEL"] == "sihsim_quadx"
    for number, call in enumerate(calls):
        assert call.arguments[:5] == ["-d", "-i", str(number), "-w", str(running.vehicles[number].output.parent)]
        assert (Path(call.arguments[5]) / "init.d-posix" / "rcS").name == "rcS"


@requires_shell
def test_gazebo_has_one_world_in_which_the_vehicles_stand_side_by_side(tmp_path: Path) -> None:
    with started("start-px4.sh", 2, tmp_path, PX4_SIM_MODEL="gz_x500_gimbal") as running:
        calls = sorted((call.environment for call in running.calls), key=lambda each: "PX4_GZ_STANDALONE" in each)
    assert [call["PX4_GZ_MODEL_POSE"] for call in calls] == ["-7.5,0", "7.5,0"]
    assert "PX4_GZ_STANDALONE" not in calls[0]
    assert len({(call["PX4_HOME_LAT"], call["PX4_HOME_LON"]) for call in calls}) == 1
    assert {call["PX4_PARAM_MNT_MODE_OUT"] for call in calls} == {"2"}


@requires_shell
def test_arducopter_gets_its_parameters_home_and_ports(tmp_path: Path) -> None:
    with started("start-ardupilot.sh", 2, tmp_path, HSOP_SITL_DIR=str(tmp_path / "state")) as running:
        pass
    for vehicle, call in zip(running.vehicles, sorted(running.calls, key=lambda each: each.folder), strict=True):
        options = dict(zip(call.arguments[::2], call.arguments[1::2], strict=True))
        assert options["--sysid"] == str(vehicle.system_id)
        assert options["--serial1"] == f"udpclient:127.0.0.1:{vehicle.port}"
        assert options["--home"].startswith(f"{vehicle.lat_deg:.7f},{vehicle.lon_deg:.7f},584,")
        files = [call.folder / name for name in options["--defaults"].split(",")]
        names = {"sitl.parm", "link.parm", "failsafe.parm", "fence.parm", "gimbal.parm", "own.parm"}
        assert {file.name for file in files if file.is_file()} == names
    own = [(call.folder / "own.parm").read_text() for call in running.calls]
    assert len(set(own)) == 2, "each returns at an altitude of its own"


@requires_shell
@pytest.mark.parametrize("script", ["start-px4.sh", "start-ardupilot.sh"])
def test_ctrl_c_ends_the_vehicles_and_leaves_nothing_behind(script: str, tmp_path: Path) -> None:
    with started(script, 2, tmp_path) as running:
        state = running.vehicles[0].output.parents[1]
        assert state.is_dir()
    assert running.process.returncode == 130
    assert not any(alive(call.pid) for call in running.calls)
    assert not state.exists()


@requires_shell
@pytest.mark.parametrize("script", ["start-px4.sh", "start-ardupilot.sh"])
def test_a_starter_that_cannot_start_says_why(script: str) -> None:
    variable = {"start-px4.sh": "HSOP_PX4_BIN", "start-ardupilot.sh": "HSOP_ARDUCOPTER_BIN"}[script]
    assert variable in refused(script, "2")
    assert "'/no/such/program'" in refused(script, "2", **{variable: "/no/such/program"})
    for count in ("0", "11", "two", ""):
        assert f"not '{count}'" in refused(script, count)


def test_two_hosts_of_a_fleet_file_take_off_in_the_simulator() -> None:
    settings, port = fleet("px4", 2), free_udp_port()
    hosts = tuple(host.model_copy(update={"connection": f"udpin:127.0.0.1:{port}"}) for host in settings.hosts)
    elsewhere = settings.model_copy(update={"hosts": hosts, "service": settings.service.model_copy(update={"port": 0})})
    origin = settings.site.origin
    home = f"--origin={origin.lat_deg},{origin.lon_deg},{origin.altitude_amsl_m}"
    options = [home, "--airborne", "0", "--position=-7.5,0", "--position=7.5,0", "--ready-after-s", "0"]
    with service(elsewhere) as client, simulated_fleet(port, 2, *options):
        reasons = {"the vehicle is not armed"}
        wait_until(lambda: {host["unavailable_reason"] for host in client.get("/api/v1/hosts").json()} == reasons)
        client.post("/api/v1/hosts/take-off", json={"altitude_m": 15, "hosts": "all"}).raise_for_status()
        places = wait_until(lambda: hovering_at(client, 15.0), limit_s=60)
    assert math.dist(*places) == pytest.approx(15.0, abs=1.0)


def hovering_at(client: httpx2.Client, altitude_m: float) -> list[list[float]]:
    """Return where the hosts are, or nothing while one of them is not within two metres of the altitude."""
    places = [host["position_enu_m"] for host in client.get("/api/v1/hosts").json()]
    return places if all(abs(up_m - altitude_m) < 2.0 for _, _, up_m in places) else []
