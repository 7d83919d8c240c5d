"""The compose files: valid, closed to the outside, and of the same vehicles as fleets and start scripts."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from hsop_gcs.settings import read_settings
from tests.docker.dockerfile import FOLDER
from tests.sitl.parameters import CONFIGS
from tests.sitl.starters import requires_shell, shells, started

CHECK_JSONSCHEMA = Path(sys.executable).with_name("check-jsonschema")
FILES = sorted(FOLDER.glob("compose.*.yaml"))
VERSION = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text())["project"]["version"]


def services(name: str) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = yaml.safe_load((FOLDER / f"compose.{name}.yaml").read_text())["services"]
    return found


def vehicles(name: str) -> list[dict[str, Any]]:
    return [each for title, each in services(name).items() if title.startswith("vehicle")]


def test_every_file_is_valid_by_the_compose_specifications_schema() -> None:
    assert len(FILES) == 3
    command = [str(CHECK_JSONSCHEMA), "--builtin-schema", "vendor.compose-spec", *map(str, FILES)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", ["simulator", "px4", "ardupilot"])
def test_only_the_api_is_reached_and_only_from_this_machine(name: str) -> None:
    published = {title: each.get("ports", []) for title, each in services(name).items()}
    assert published.pop("service") == ["127.0.0.1:8080:8080"]
    assert not any(published.values())
    assert all(vehicle["network_mode"] == "service:service" for vehicle in vehicles(name))
    assert f"hsop-gcs:{VERSION}" == services(name)["service"]["image"]
    images = [each["image"] for each in services(name).values()]
    assert all(re.search(r":(\w+-)?v?\d[\w.]*}?$|:\?", image) for image in images), "no image without a version"


@pytest.mark.parametrize("name", ["simulator", "px4", "ardupilot"])
def test_the_service_reads_a_fleet_file_of_the_image(name: str) -> None:
    config = services(name)["service"]["command"][1].removeprefix("--config=/etc/hsop-gcs/")
    fleet = read_settings(CONFIGS / config.replace("${HSOP_VEHICLES:-4}", "4"))
    assert len(fleet.hosts) == 4
    mounted = services(name)["service"]["volumes"]
    assert mounted == ["journal:/var/lib/hsop-gcs"]


@requires_shell
def test_px4s_environment_is_the_start_scripts() -> None:
    script = [*shells(), str(CONFIGS / "start-px4.sh"), "--env"]
    printed = subprocess.run(script, capture_output=True, text=True, check=True, timeout=30).stdout
    assert (FOLDER / "px4.env").read_text() == printed


@requires_shell
def test_px4_containers_are_the_vehicles_of_the_start_script(tmp_path: Path) -> None:
    with started("start-px4.sh", 4, tmp_path) as running:
        calls = {call.arguments[2]: call.environment for call in running.calls}
    containers = vehicles("px4")
    assert len(containers) == 4
    for container in containers:
        (instance,) = container["command"]
        assert container["environment"].items() <= calls[instance].items()
        assert {"PX4_HOME_LAT", "PX4_HOME_LON", "PX4_HOME_ALT", "PX4_PARAM_RTL_RETURN_ALT"} == set(
            container["environment"]
        )


@requires_shell
def test_arducopter_containers_are_the_vehicles_of_the_start_script(tmp_path: Path) -> None:
    with started("start-ardupilot.sh", 4, tmp_path, HSOP_SITL_DIR=str(tmp_path / "state")) as running:
        calls = {call.folder: call.arguments for call in running.calls}
    document = yaml.safe_load((FOLDER / "compose.ardupilot.yaml").read_text())
    for (folder, call), container in zip(sorted(calls.items()), vehicles("ardupilot"), strict=True):
        options = dict(zip(call[::2], call[1::2], strict=True))
        given = dict(option.split("=", 1) for option in container["command"])
        files, wanted = given.pop("--defaults").split(","), options.pop("--defaults").split(",")
        assert given == options
        assert [Path(file).name for file in files] == wanted
        own = document["configs"][container["configs"][0]["source"]]["content"]
        assert own.splitlines() == (folder / "own.parm").read_text().splitlines()[1:]
