"""The table that ``hsop-gcs demo`` ends with, for an outcome that is given."""

from dataclasses import replace

import pytest
from typer import Typer
from typer.testing import CliRunner, Result

from hsop_gcs.cli import demo as command
from hsop_gcs.demo import Errors, Outcome, Row, Summary

ARRIVED = Outcome(
    summary=Summary(
        threats=2,
        hosts=1,
        all_arrived=True,
        hover_error_m=0.42,
        heading_error_deg=-1.25,
        gimbal_error_deg=0.31,
        duration_s=61.0,
        report_error_m=14.0,
        final_error_m=0.5,
        journal="/tmp/journal",
    ),
    rows=(
        Row(
            host="h1",
            status="on station",
            hover_error_m=0.42,
            heading_error_deg=-1.25,
            gimbal_error_deg=0.31,
            sees=(("t1", "central"), ("t2", "peripheral")),
        ),
    ),
    errors=Errors(reports_m=14.0, first_fix_m=2.0, final_m=0.5),
    plan_cost=1.23456,
    problem="",
)


def demo(monkeypatch: pytest.MonkeyPatch, outcome: Outcome) -> Result:
    async def run_demo(autopilot: str) -> Outcome:
        assert autopilot == "px4"
        return outcome

    monkeypatch.setattr("hsop_gcs.demo.run_demo", run_demo)
    app = Typer()
    command.register(app)
    return CliRunner().invoke(app, [], env={"COLUMNS": "100"})


def test_the_table_tells_of_each_host_its_errors_and_what_it_sees_and_then_the_cost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ran = demo(monkeypatch, ARRIVED)
    assert ran.exit_code == 0
    row = next(line for line in ran.stdout.splitlines() if "h1" in line)
    for cell in ("on station", "0.42 m", "-1.25°", "0.31°", "t1 (central), t2 (peripheral)"):
        assert cell in row
    assert "plan cost 1.2346" in ran.stdout.split(row)[1]


def test_a_host_that_did_not_arrive_is_exit_code_1_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    late = replace(ARRIVED, summary=replace(ARRIVED.summary, all_arrived=False), problem="h1 is still on its way")
    ran = demo(monkeypatch, late)
    assert ran.exit_code == 1
    assert "Not all hosts are on station" in ran.stdout
    assert ran.stderr == "hsop-gcs: h1 is still on its way\n"
