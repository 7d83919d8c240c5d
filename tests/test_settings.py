"""FLEET.toml: what is read, and how faults are told."""

import math
from pathlib import Path

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.mission.state import Autonomy
from hsop_gcs.settings import read_settings

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


def test_what_is_not_said_has_the_letters_values_and_nothing_moves_unapproved(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    path.write_text(GOOD)
    settings = read_settings(path)
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
        (("udpout:127.0.0.1:14582", "tcp:127.0.0.1"), r"hosts\.1\.connection: .*tcp:127\.0\.0\.1"),
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
