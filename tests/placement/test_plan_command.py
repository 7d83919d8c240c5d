"""``hsop-gcs plan`` as its users run it: a process of its own, its exit code and what it prints."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.oracles.check_plan import check
from tests.placement.examples import SCENARIOS, read

TWO = str(SCENARIOS / "2-threats-102.json")
TWICE = '{"threats": [{"id": "a", "position_m": [0, 0]}, {"id": "a", "position_m": [9, 0]}]}'


def plan(*arguments: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "hsop_gcs", "plan", *arguments],
        input=stdin,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_a_plan_is_a_table_of_at_most_80_columns_and_exit_0() -> None:
    ran = plan(TWO, "--formulation", "letter")
    assert ran.returncode == 0, ran.stderr
    assert max(len(line) for line in ran.stdout.splitlines()) <= 80
    for word in ("h1", "t1", "heading", "pan", "expected error", "cost", "lower bound"):
        assert word in ran.stdout


def test_the_default_is_operational_and_json_goes_to_stdout_and_into_the_file(tmp_path: Path) -> None:
    written = tmp_path / "plan.json"
    ran = plan(TWO, "--hosts", "3", "--json", "-o", str(written))
    assert ran.returncode == 0, ran.stderr
    printed = json.loads(ran.stdout)
    assert printed == json.loads(written.read_text())
    assert (printed["formulation"], printed["n_hosts"], printed["method"]) == ("operational", 3, "search")
    verdict = check(read("2-threats-102"), printed, segment=True)
    assert verdict["ok"], verdict["problems"]


def test_a_scenario_may_come_from_standard_input_and_the_baseline_may_be_asked_for() -> None:
    ran = plan("-", "--json", "--method", "coverage-only", stdin=Path(TWO).read_text())
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["method"] == "coverage-only"


def test_an_infeasible_scenario_is_exit_3_with_one_line_and_a_plan_file_that_says_why(tmp_path: Path) -> None:
    scenario = json.dumps({"threats": [{"id": "jet", "position_m": [0, 0], "velocity_mps": [40, 0]}]})
    written = tmp_path / "plan.json"
    ran = plan("-", "-o", str(written), stdin=scenario)
    assert ran.returncode == 3
    assert ran.stdout == ""
    assert ran.stderr.startswith("hsop-gcs: infeasible: threat jet flies 400.0 m")
    assert ran.stderr.count("\n") == 1
    kept = json.loads(written.read_text())
    assert kept["status"] == "infeasible"
    assert kept["reason"].startswith("threat jet flies 400.0 m")


def test_a_plan_that_leaves_threats_out_is_exit_3_and_names_them(tmp_path: Path) -> None:
    threats = [{"id": "a", "position_m": [0, 0]}, {"id": "far", "position_m": [900, 0]}]
    hosts = [{"id": f"h{k}", "position_m": [20 * k, 50]} for k in range(3)]
    written = tmp_path / "plan.json"
    ran = plan("-", "-o", str(written), stdin=json.dumps({"threats": threats, "hosts": hosts}))
    assert ran.returncode == 3
    assert "1 threats" in ran.stdout
    assert ran.stderr == (
        "hsop-gcs: left out: threat far is left for the other: no placement of 2 hosts for all 2 was found\n"
    )
    kept = json.loads(written.read_text())
    assert (kept["status"], list(kept["left_out"])) == ("partial", ["far"])
    verdict = check({"threats": threats[:1]}, kept, segment=True)
    assert verdict["ok"], verdict["problems"]


@pytest.mark.parametrize(
    ("arguments", "stdin", "message"),
    [
        ([TWO, "--hosts", "1"], "", "--hosts: 1 is outside 2..4"),
        ([TWO, "--hosts", "5"], "", "--hosts: 5 is outside 2..4"),
        ([TWO, "--formulation", "mine"], "", "--formulation: 'mine' is not one of letter, operational"),
        ([TWO, "--objective", "beauty"], "", "--objective: 'beauty' is not one of"),
        ([TWO, "--method", "magic"], "", "--method: 'magic' is not one of"),
        ([TWO, "--time-limit", "0"], "", "--time-limit: must be above 0"),
        ([TWO, "--time-limit", "nan"], "", "--time-limit: must be above 0"),
        ([TWO, "--seed", "-1"], "", "--seed: must not be negative, not -1"),
        ([TWO, "--initial-observers"], "", "hosts: current positions are needed"),
        ([TWO, "-o", "no/such/directory/plan.json"], "", "--output: no/such/directory/plan.json"),
        (["no-such-file.json"], "", "no-such-file.json: No such file or directory"),
        ([str(SCENARIOS)], "", "Is a directory"),
        (["-"], "{\n  3", "-: not JSON: Expecting property name enclosed in double quotes at line 2 column 3"),
        (["-"], '{"threats": []}', "threats: there are none to place hosts for"),
        (["-"], TWICE, "threats[1].id: 'a' is given twice"),
        (["-"], '{"threats": [{"id": "a", "position_m": [0, NaN]}]}', "threats[0].position_m: must be finite, not NaN"),
    ],
)
def test_bad_input_is_exit_2_and_one_line_naming_it(arguments: list[str], stdin: str, message: str) -> None:
    ran = plan(*arguments, stdin=stdin)
    assert ran.returncode == 2
    assert message in ran.stderr
    assert ran.stderr.startswith("hsop-gcs: ")
    assert ran.stderr.count("\n") == 1
    assert ran.stdout == ""
