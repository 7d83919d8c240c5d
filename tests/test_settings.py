"""FLEET.toml: what is read, and how faults are told."""

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
