"""``hsop-gcs plan --frontier`` and ``--target-error`` as their users run them."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.oracles.check_plan import check
from tests.placement.examples import SCENARIOS, read
from tests.placement.test_plan_command import plan

TWO = str(SCENARIOS / "2-threats-102.json")
FEW = ("--iterations", "2", "--formulation", "letter")


def test_a_frontier_is_a_table_of_at_most_80_columns_with_every_number_of_hosts() -> None:
    ran = plan(TWO, "--frontier", *FEW)
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[1] for line in lines if line.startswith("│")] == ["2", "3", "4"]


def test_a_frontiers_plans_go_to_stdout_into_the_file_and_into_a_picture(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    written, drawn = tmp_path / "frontier.json", tmp_path / "frontier.png"
    ran = plan(TWO, "--frontier", *FEW, "--json", "-o", str(written), "--plot", str(drawn))
    assert ran.returncode == 0, ran.stderr
    printed = json.loads(ran.stdout)
    assert printed == json.loads(written.read_text())
    assert drawn.read_bytes().startswith(b"\x89PNG")
    costs = []
    for number, row in enumerate(printed["frontier"], start=2):
        assert row["n_hosts"] == row["plan"]["n_hosts"] == number
        errors_m = [pair["expected_error_m"] for pair in row["plan"]["pairs"]]
        assert row["worst_expected_error_m"] == max(errors_m)
        verdict = check(read("2-threats-102"), row["plan"], segment=False)
        assert verdict["ok"], verdict["problems"]
        costs.append(row["cost"])
    assert costs == sorted(costs, reverse=True)


def test_without_matplotlib_a_picture_is_refused_before_the_search_begins(tmp_path: Path) -> None:
    without = "import sys; sys.modules['matplotlib'] = None; from hsop_gcs.cli import main; main()"
    drawn = str(tmp_path / "frontier.png")
    ran = subprocess.run(
        [sys.executable, "-c", without, "plan", TWO, "--frontier", "--time-limit", "1000", "--plot", drawn],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ran.returncode == 2
    assert "--plot: needs matplotlib; install hsop-gcs[plots]" in ran.stderr


def test_the_same_rounds_give_the_same_frontier_in_another_process() -> None:
    first, second = (json.loads(plan(TWO, "--frontier", *FEW, "--json").stdout)["frontier"] for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert {**one["plan"], "solve_time_s": 0} == {**other["plan"], "solve_time_s": 0}


def test_a_target_error_takes_the_fewest_hosts_that_reach_it() -> None:
    ran = plan(TWO, "--target-error", "1.0", *FEW, "--json")
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    assert max(pair["expected_error_m"] for pair in found["pairs"]) <= 1.0
    fewer = json.loads(plan(TWO, "--hosts", str(found["n_hosts"] - 1), *FEW, "--json").stdout)
    assert max(pair["expected_error_m"] for pair in fewer["pairs"]) > 1.0


def test_a_target_error_out_of_reach_is_exit_3_and_the_best_there_is() -> None:
    ran = plan(TWO, "--target-error", "0.001", *FEW, "--json")
    assert ran.returncode == 3
    assert json.loads(ran.stdout)["n_hosts"] == 4
    assert ran.stderr.startswith("hsop-gcs: expected error ")
    assert ran.stderr.endswith("0.001 m is out of reach\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--frontier", "--hosts", "3"], "--hosts: does not go with --frontier"),
        (["--frontier", "--method", "letter"], "--method: does not go with --frontier"),
        (["--frontier", "--target-error", "1"], "--target-error: does not go with --frontier"),
        (["--plot", "x.png"], "--plot: draws a frontier"),
        (["--iterations", "0"], "--iterations: must be 1 or more, not 0"),
        (["--iterations", "2", "--method", "letter"], "--iterations: method letter has no rounds"),
        (["--target-error", "0"], "--target-error: must be above 0"),
        (["--target-error", "nan"], "--target-error: must be above 0"),
        (["--target-error", "1", "--hosts", "3"], "target_error_m: decides how many hosts"),
        (["--frontier", "-o", "no/such/directory/f.json"], "--output: no/such/directory/f.json"),
    ],
)
def test_a_fault_is_one_line_and_exit_2(arguments: list[str], message: str) -> None:
    ran = plan(TWO, *arguments)
    assert ran.returncode == 2
    assert ran.stderr.startswith(f"hsop-gcs: {message}")
    assert ran.stderr.count("\n") == 1


def test_an_infeasible_frontier_is_exit_3_and_says_why() -> None:
    scenario = json.dumps({"threats": [{"id": "jet", "position_m": [0, 0], "velocity_mps": [40, 0]}]})
    ran = plan("-", "--frontier", "--iterations", "1", stdin=scenario)
    assert ran.returncode == 3
    assert ran.stderr.startswith("hsop-gcs: infeasible: threat jet flies 400.0 m")
