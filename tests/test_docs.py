"""docs/planning.md names every field of a scenario file and every planning setting, with its default; what docs show as
files are such files.
"""

import json
import re
from pathlib import Path

import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.geometry.frames import GeodeticPoint
from hsop_gcs.placement.scenario import problem_from_json
from hsop_gcs.settings.sections import PlanningSection
from hsop_gcs.simulator.truth import truth_from_json

DOCS = Path(__file__).parents[1] / "docs"
TEXT = (DOCS / "planning.md").read_text(encoding="utf-8")
SCENARIO, MINIMISED = TEXT.split("## What is minimised")
SETTINGS = MINIMISED.split("## `[planning]` of FLEET.toml")[1]


def example(text: str = SCENARIO) -> dict[str, object]:
    return dict(json.loads(text.split("```json")[1].split("```")[0]))


def test_the_scenario_shown_is_one() -> None:
    problem = problem_from_json(example())
    assert (len(problem.threats), len(problem.hosts), len(problem.rigs)) == (1, 2, 2)


@pytest.mark.parametrize("document", ["planning.md", "simulator.md"])
def test_the_truth_shown_and_the_scenario_are_what_simulated_cameras_can_be_given(document: str) -> None:
    origin = GeodeticPoint(lat_deg=47.397742, lon_deg=8.545594, altitude_amsl_m=488.0)
    given = example((DOCS / document).read_text(encoding="utf-8"))
    assert "t1" in {threat.id for threat in truth_from_json(given, origin).threats}


@pytest.mark.parametrize("place", ["parameters", "threats", "hosts", "keep_outs"])
def test_every_field_that_a_scenario_may_have_is_told(place: str) -> None:
    scenario = example()
    item = scenario[place]
    spoilt = {"unheard_of": 1} if isinstance(item, dict) else [{"unheard_of": 1}]
    with pytest.raises(BadInput, match="may have") as refused:
        problem_from_json({**scenario, place: spoilt})
    known = refused.value.problem.split("may have ")[1].split(", ")
    table = "\n".join(line for line in SCENARIO.splitlines() if line.startswith(f"| `{place}"))
    assert [name for name in known if not re.search(rf"[`.]{name}`", table)] == []


def test_every_planning_setting_is_told_with_its_default() -> None:
    rows = {
        name: cells[2].strip().strip("`")
        for line in SETTINGS.splitlines()
        if line.startswith("| `")
        for cells in [line.split("|")]
        for name in re.findall(r"`(\w+)`", cells[1])
    }
    assert set(rows) == set(PlanningSection.model_fields)
    defaults = PlanningSection().model_dump(mode="json")
    told = {name: default for name, default in rows.items() if name != "hosts"}
    assert {name: str(default) for name, default in told.items()} == {
        name: f"{value:g}" if isinstance(value, int | float) else value
        for name, value in defaults.items()
        if name != "hosts"
    }
    assert str(defaults["hosts"]["target_error_m"]) in rows["hosts"]
