"""The figures come out the same every time and say what the letter says."""

from pathlib import Path

import numpy as np
import pytest

from hsop_gcs.errors import BadInput
from hsop_gcs.placement.pair_sets import backtrack, generate_pairs
from hsop_gcs.study.figures import FIGURES, draw
from hsop_gcs.study.figures import placements as drawn

rc_context = pytest.importorskip("matplotlib").rc_context


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_the_same_to_the_byte_when_drawn_again(name: str, tmp_path: Path) -> None:
    (tmp_path / "first").mkdir()
    (tmp_path / "second").mkdir()
    lines = draw(name, tmp_path / "first")
    with rc_context({"lines.linewidth": 7.0, "figure.facecolor": "black", "svg.fonttype": "none"}):  # of a matplotlibrc
        assert draw(name, tmp_path / "second") == lines
    for suffix in ("svg", "png"):
        first = (tmp_path / "first" / f"{name}.{suffix}").read_bytes()
        assert len(first) > 5000
        assert first == (tmp_path / "second" / f"{name}.{suffix}").read_bytes()


@pytest.mark.parametrize("n_hosts", [2, 3, 4])
def test_static_threats_are_seen_at_right_angles(n_hosts: int) -> None:
    problem = drawn.static_problem()
    placement = drawn.placed(problem, n_hosts)
    assert drawn.angles_deg(problem, placement) == pytest.approx(np.full(4, 90.0), abs=5.0)


def test_hosts_become_fewer_as_mobile_threats_approach_each_other() -> None:
    hosts = [len(drawn.placed(problem, None).hosts) for problem in drawn.mobile_problems()]
    assert hosts[0] > hosts[-1] == 2


def test_relative_pixel_size_is_full_on_the_boresight_and_nothing_at_90_degrees(tmp_path: Path) -> None:
    (line,) = draw("fig02-pixel-size", tmp_path)
    assert line.startswith("100 % on the boresight")
    assert line.endswith(" 0 % at 90°")


def test_the_tree_of_fig_7_has_27_leaves_and_prunes_after_two_threats(tmp_path: Path) -> None:
    unpruned = backtrack(3, lambda known: generate_pairs(4, len(known)), lambda _: True)
    assert len(list(unpruned)) == 27
    (line,) = draw("fig07-backtracking", tmp_path)
    assert "7 of 9 pruned after two threats" in line
    assert "6 feasible" in line


def test_a_file_that_is_no_study_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rows.json").write_text("[]")
    with pytest.raises(BadInput, match="rows"):
        draw("fig11-error", tmp_path, tmp_path / "rows.json")
