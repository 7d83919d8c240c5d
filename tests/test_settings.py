"""FLEET.toml: what is read, and how faults are told."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.mission.inputs import Rules
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.settings import check_settings, read_settings

GOOD = """
[site]
origin = { lat_deg = 47.3977, lon_deg = 8.5456, altitude_amsl_m = 488.0 }

[[hosts]]
id = "h1"
system_id = 1
connection = "udpin:127.0.0.1:14541"

[[hosts]]
id = "h2"
system_id = 2
connection = "udpout:127.0.0.1:14582"
"""


def read(tmp_path: Path, text: str) -> object:
    path = tmp_path / "FLEET.toml"
    path.write_text(text)
    return read_settings(path)


def test_an_aircraft_has_its_remote_ids_to_itself(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    both = GOOD.replace("system_id = 1\n", 'system_id = 1\nremote_id = ["1581F 4XQ", "3C65AC"]\n')
    path.write_text(both)
    settings = read_settings(path)
    assert settings.to_fleet().hosts[0].remote_id == ("1581F 4XQ", "3C65AC")
    assert settings.to_rules().remote_ids == {"1581f4xq": "h1", "3c65ac": "h1"}
    path.write_text(both.replace("system_id = 2\n", 'system_id = 2\nremote_id = ["3c65ac"]\n'))
    with pytest.raises(BadInput, match="hosts 'h1' and 'h2' both have remote_id"):
        read_settings(path)


def test_what_is_not_said_has_the_letters_values_and_nothing_moves_unapproved(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD)
    settings = read_settings(path)
    assert settings.to_rules() == Rules()
    assert settings.service.autonomy is Autonomy.CONFIRM
    rules = settings.to_planning_rules()
    assert (rules.horizon_s, rules.safety_distance_m, rules.formulation) == (10.0, 20.0, "operational")
    assert [host.system_id for host in settings.to_fleet().hosts] == [1, 2]


def test_the_fence_and_keep_outs_arrive_in_local_metres(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(
        GOOD
        + """
[fence]
inside = [[47.3967, 8.5446], [47.3987, 8.5446], [47.3987, 8.5466], [47.3967, 8.5466]]

[[keep_out]]
polygon = [[47.3977, 8.5456], [47.3978, 8.5456], [47.3978, 8.5458]]
ceiling_m = 30.0
"""
    )
    rules = read_settings(path).to_planning_rules()
    assert rules.airspace.fence_room_m((0.0, 0.0, 50.0)) == pytest.approx(75.5, abs=0.5)
    (tower,) = rules.airspace.keep_outs
    # A ten-thousandth of a degree of latitude is 11.12 m.
    assert tower.polygon[1] == pytest.approx((0.0, 11.12), abs=0.01)
    assert (tower.floor_m, tower.ceiling_m) == (-math.inf, 30.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("lat_deg = 47.3977", "lat_deg = 95"), r"site\.origin\.lat_deg: .*less than or equal to 90 \(given: 95\)"),
        (("lat_deg = 47.3977", "lat_deg = nan"), r"site\.origin\.lat_deg: .*nan"),
        (("system_id = 2", "system_id = 1"), "hosts|input: two hosts have system_id 1"),
        (('id = "h2"', 'id = "h1"'), "two hosts have id 'h1'"),
        (
            ("system_id = 1\n", 'system_id = 1\nremote_id = ["1581F", " 1581f "]\n'),
            "host 'h1' has remote_id '1581F' twice",
        ),
        (("system_id = 1\n", 'system_id = 1\nremote_id = [" "]\n'), r"hosts\.0\.remote_id\.0: must not be blank"),
        (("udpout:127.0.0.1:14582", "tcp:127.0.0.1"), r"hosts\.1\.connection: 'tcp:127\.0\.0\.1' is none of udpin"),
        (("udpout:127.0.0.1:14582", "serial:/dev/ttyS0:9"), r"hosts\.1\.connection: baud rate 9 in .* is not 1200"),
        (("[site]", "[planning]\nhosts = 1\n[site]"), r"planning\.hosts"),
        (
            ("[site]", "[service]\nautonomy = 'yolo'\n[site]"),
            r"service\.autonomy: .*'advise', 'confirm' or 'auto'.*yolo",
        ),
        (("[site]", "[limits]\nfloor_m = 50\nceiling_m = 40\n[site]"), "limits: floor_m 50 must be below ceiling_m 40"),
        (("[site]", "[fence]\ninside = [[47.4, 8.5], [47.5, 8.5]]\n[site]"), r"fence\.inside: .*at least 3"),
        (("[site]", "[fence]\ninside = [[47.4, 8.5], [97, 8.5], [47, 8]]\n[site]"), r"fence\.inside\.1\.0: .*97"),
        (("[site]", "[sites]"), "site: field required"),
        (("[site]", "[site"), "not TOML"),
    ],
)
def test_a_fault_names_the_field_and_the_value(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read(tmp_path, GOOD.replace(*change))


def test_a_file_that_is_not_there_is_said_so(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="--config: cannot read"):
        read_settings(tmp_path / "none.toml")


def test_all_faults_are_told_at_once_each_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    text = GOOD.replace("lat_deg = 47.3977", "lat_deg = 95").replace('id = "h2"', 'id = "h1"')
    path.write_text(text + '\n[limits]\nfloor_m = 50\nceiling_m = 40\n\n[fence]\nfile = "none.kml"\n')
    settings, faults = check_settings(path)
    assert settings is None
    lines = path.read_text().splitlines()
    told = {fault.field: (fault.problem, lines[(fault.line or 0) - 1]) for fault in faults}
    assert set(told) == {"site.origin.lat_deg", "hosts", "limits", "fence.file"}
    assert told["site.origin.lat_deg"][1].startswith("origin =")
    assert told["limits"] == ("floor_m 50 must be below ceiling_m 40", "[limits]")
    assert "none.kml: cannot be read" in told["fence.file"][0]
    assert told["fence.file"][1] == 'file = "none.kml"'
    with pytest.raises(BadInput, match=r"and 3 more: hsop-gcs check-config"):
        read_settings(path)


def test_areas_come_from_files_beside_the_fleet_file(tmp_path: Path) -> None:
    plan = {
        "fileType": "Plan",
        "geoFence": {
            "polygons": [{"inclusion": True, "polygon": [[47.39, 8.54], [47.41, 8.54], [47.41, 8.56], [47.39, 8.56]]}],
            "circles": [{"inclusion": False, "circle": {"center": [47.3977, 8.5456], "radius": 30}}],
        },
    }
    ring = [[8.5476, 47.3977], [8.5478, 47.3977], [8.5478, 47.3979], [8.5476, 47.3977]]
    tower = {"type": "Polygon", "coordinates": [ring]}
    (tmp_path / "site.plan").write_text(json.dumps(plan))
    (tmp_path / "tower.geojson").write_text(json.dumps(tower))
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD + '\n[fence]\nfile = "site.plan"\n[[keep_out]]\nfile = "tower.geojson"\nceiling_m = 25.0\n')
    airspace = read_settings(path).to_airspace()
    assert airspace.fence_room_m((0.0, 0.0, 40.0)) > 400
    circle, tower_area = airspace.keep_outs
    assert circle.room_m((0.0, 0.0, 40.0)) == pytest.approx(-30.0, abs=0.2)
    assert (len(tower_area.polygon), tower_area.ceiling_m) == (3, 25.0)


@pytest.mark.parametrize(
    ("areas", "message"),
    [
        ("[fence]", "fence: needs inside or file"),
        ("[fence]\ninside = [[8.54, 47.39], [8.56, 47.39], [8.56, 47.41]]", r"fence: has a corner 54\.\d° from site"),
        ("[fence]\ninside = [[47.39, 8.54], [47.41, 8.56], [47.41, 8.54], [47.39, 8.56]]", "fence.inside: is no area"),
        ("[[keep_out]]\nfloor_m = 3", "keep_out.0: needs polygon or file"),
        (
            "[[keep_out]]\npolygon = [[47.39, 8.54], [47.41, 8.56], [47.41, 8.54]]\nfloor_m = 9\nceiling_m = 8",
            "keep_out.0: floor_m 9 must be below ceiling_m 8",
        ),
    ],
)
def test_an_area_nobody_can_mean_is_a_fault(tmp_path: Path, areas: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read(tmp_path, GOOD + "\n" + areas)


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "hsop_gcs", "check-config", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_the_command_sums_up_a_good_file_and_lists_the_faults_of_a_bad_one(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD)
    good = check(str(path))
    assert (good.returncode, good.stderr) == (0, "")
    assert "h2: system 2, udpout:127.0.0.1:14582" in good.stdout
    path.write_text(GOOD.replace("lat_deg = 47.3977", "lat_deg = 95").replace("system_id = 2", "system_id = 0"))
    bad = check(str(path))
    assert (bad.returncode, bad.stdout) == (2, "")
    assert [line.split(": ")[1] for line in bad.stderr.splitlines()] == ["site.origin.lat_deg", "hosts.1.system_id"]
    assert f"{path}:12: hosts.1.system_id" in bad.stderr
    faults = json.loads(check(str(path), "--json").stdout)["faults"]
    assert [fault["field"] for fault in faults] == ["site.origin.lat_deg", "hosts.1.system_id"]


RIGS = """
[rig.central]
fov_deg = 60.0

[rigs.sharp]
tilt_deg = [-90.0, 25.0]
central = { resolution_px = 1920 }

[rigs.measured]
calibration = "lens.json"
peripheral = { min_pixels = 6.0 }
"""


def test_hosts_carry_the_rigs_that_are_named_for_them(tmp_path: Path) -> None:
    lens = {"K": [[400.0, 0, 700], [0, 402.0, 700], [0, 0, 1]], "D": [0.01, 0.0, 0.0, 0.0], "image_width": 1400}
    (tmp_path / "lens.json").write_text(json.dumps(lens))
    path = tmp_path / "FLEET.toml"
    more = (
        '[[hosts]]\nid = "h3"\nsystem_id = 3\nconnection = "udpin:127.0.0.1:14543"\nrig = "sharp"\n'
        '[[hosts]]\nid = "h4"\nsystem_id = 4\nconnection = "udpin:127.0.0.1:14544"\nrig = "measured"\n'
    )
    path.write_text(GOOD + more + RIGS)
    fleet = read_settings(path).to_fleet()
    rigs = fleet.rigs()
    assert fleet.rig.central.fov_deg == 60.0
    assert rigs["h1"] == fleet.rig
    assert rigs["h3"].peripheral == fleet.rig.peripheral
    assert (rigs["h3"].central.resolution_px, rigs["h3"].central.fov_deg) == (1920, 53.0)
    assert rigs["h4"].peripheral.focal_length_px == pytest.approx(401.0)
    assert (rigs["h4"].peripheral.min_pixels, rigs["h4"].peripheral.distortion[0]) == (6.0, 0.01)
    assert rigs["h4"].central == fleet.rig.central
    assert (rigs["h3"].tilt_deg, rigs["h4"].tilt_deg) == ((-90.0, 25.0), (-90.0, 90.0))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("rigs.sharp", "rigs.blunt"), "host 'h3': there is no \\[rigs.sharp\\]"),
        (("lens.json", "none.json"), "rigs.measured.calibration: .*none.json: No such file"),
        (('"lens.json"', "3"), "rigs.measured.calibration: must be the name of a file"),
        (("resolution_px = 1920", "resolution_px = 0"), "rigs.sharp.central.resolution_px"),
        (("min_pixels = 6.0", "focal_length_mm = 1.2"), "the calibration file says what peripheral.focal_length_mm is"),
        (("[rig.central]", "[rig.peripheral]\ndistortion = [-9, 0, 0, 0]\n[rig.central]"), "rig: .*must grow up to 90"),
    ],
)
def test_a_rig_that_no_host_can_carry_is_a_fault(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    lens = {"K": [[400.0, 0, 700], [0, 402.0, 700], [0, 0, 1]], "D": [0.01, 0.0, 0.0, 0.0], "image_width": 1400}
    (tmp_path / "lens.json").write_text(json.dumps(lens))
    more = '[[hosts]]\nid = "h3"\nsystem_id = 3\nconnection = "udpin:127.0.0.1:14543"\nrig = "sharp"\n'
    path = tmp_path / "FLEET.toml"
    assert change[0] in RIGS
    path.write_text(GOOD + more + RIGS.replace(*change))
    with pytest.raises(BadInput, match=message):
        read_settings(path)


def test_each_host_may_have_a_port_for_mavsdk_and_the_summary_tells_it(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD + "mavsdk_port = 14601\n")
    assert [host.mavsdk_port for host in read_settings(path).hosts] == [None, 14601]
    assert "h2: system 2, udpout:127.0.0.1:14582, MAVSDK at udpout://127.0.0.1:14601\n" in check(str(path)).stdout


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("0", r"hosts\.1\.mavsdk_port: .*0"),
        ("14541", "hosts: mavsdk_port 14541 of 'h2' is that of a connection"),
        (
            '9\n[[hosts]]\nid = "h3"\nsystem_id = 3\nconnection = "udpin:127.0.0.1:14543"\nmavsdk_port = 9',
            "hosts: two hosts have mavsdk_port 9",
        ),
    ],
)
def test_a_port_for_mavsdk_that_cannot_be_is_a_fault(tmp_path: Path, port: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read(tmp_path, f"{GOOD}mavsdk_port = {port}\n")


def test_connections_that_cannot_all_be_open_are_a_fault_before_the_service_is_started(tmp_path: Path) -> None:
    more = '[[hosts]]\nid = "h3"\nsystem_id = 3\nconnection = "udpin:0.0.0.0:{}"\n'
    read(tmp_path, GOOD + more.format(14543))
    with pytest.raises(BadInput, match=r"udpin:127\.0\.0\.1:14541 and udpin:0\.0\.0\.0:14541 cannot be open at a time"):
        read(tmp_path, GOOD + more.format(14541))


def key_file(path: Path, mode: int = 0o600) -> Path:
    path.write_text("ab" * 32)
    path.chmod(mode)
    return path


def test_signing_keys_belong_to_the_fleet_or_to_hosts_and_lie_beside_the_fleet_file(tmp_path: Path) -> None:
    fleet, own = key_file(tmp_path / "fleet.key"), key_file(tmp_path / "h2.key")
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD + 'key_file = "h2.key"\n[signing]\nkey_file = "fleet.key"\n')
    assert read_settings(path).key_files() == {"udpin:127.0.0.1:14541": fleet, "udpout:127.0.0.1:14582": own}
    path.write_text(GOOD)
    assert read_settings(path).key_files() == {}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            '[signing]\nkey_file = "open.key"',
            r"signing\.key_file: '.*open\.key' is open to others \(mode 0640\): chmod 600",
        ),
        ('[signing]\nkey_file = "none.key"', r"signing\.key_file: cannot read '.*none\.key'"),
        ('key_file = "open.key"', r"hosts\.1\.key_file: .* is open to others"),
        ('[signing]\nallow_unsigned = ["NOTHING"]', r"signing\.allow_unsigned: 'NOTHING' is no MAVLink message"),
        ("[signing]\nlink_id = 256", r"signing\.link_id: .*256"),
        (
            'key_file = "own.key"\n[[hosts]]\nid = "h3"\nsystem_id = 3\nconnection = "udpout:127.0.0.1:14582"',
            "hosts: those behind udpout:127.0.0.1:14582 must have the same key_file",
        ),
    ],
)
def test_faults_of_signing_name_the_field(tmp_path: Path, more: str, message: str) -> None:
    key_file(tmp_path / "open.key", 0o640)
    key_file(tmp_path / "own.key")
    with pytest.raises(BadInput, match=message):
        read(tmp_path, GOOD + more)


def test_a_host_is_pinned_to_an_address_where_many_may_speak(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD.replace('14541"', '14541"\naddress = "10.0.0.5:14550"'))
    assert [host.address for host in read_settings(path).hosts] == ["10.0.0.5:14550", None]
    assert read_settings(path).to_fleet().hosts[0].id == "h1"


@pytest.mark.parametrize(
    ("address", "after", "problem"),
    [
        ("drone1", '14541"', r"hosts\.0\.address: 'drone1' is no IP address, with or without :PORT"),
        ("10.0.0.5:0", '14541"', r"hosts\.0\.address: '0' in '10\.0\.0\.5:0' is not a port"),
        ("10.0.0.5", '14582"', "host 'h2': address is for a udpin connection; udpout:127.0.0.1:14582 has only one"),
    ],
)
def test_an_address_that_pins_nothing_is_refused(tmp_path: Path, address: str, after: str, problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        read(tmp_path, GOOD.replace(after, f'{after}\naddress = "{address}"'))
