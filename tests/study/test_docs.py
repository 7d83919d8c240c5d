"""The numbers in docs/ are those of the full study and of the figures as they are drawn."""

import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from hsop_gcs.study import figures
from hsop_gcs.study.assumptions import Assumptions
from hsop_gcs.study.claims import Claim, claims_markdown, shares_markdown
from hsop_gcs.study.localization import Estimator
from hsop_gcs.study.placements import Kind
from hsop_gcs.study.sensitivity import Outcome, table_line, variants
from hsop_gcs.study.summary import Row, error_of, markdown
from hsop_gcs.study.trial import Study

DOCS = Path(__file__).parents[2] / "docs"


def stored(name: str) -> Any:
    return json.loads(files(figures).joinpath(name).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def study() -> dict[str, Any]:
    return dict(stored("letter-study.json"))


@pytest.fixture(scope="module")
def text() -> str:
    return (DOCS / "study.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def gallery() -> str:
    return (DOCS / "figures.md").read_text(encoding="utf-8")


def test_the_study_that_comes_with_the_package_is_the_full_one_of_the_defaults(study: dict[str, Any]) -> None:
    assert study["study"] == json.loads(json.dumps(Study().as_json()))
    hosts = {(row["threats"], row["hosts"]) for row in study["rows"]}
    assert hosts == {(threats, n) for threats in (2, 3, 4) for n in range(2, 2 * threats + 1)}
    assert len(study["rows"]) == len(hosts) * len(Kind) * len(Estimator)


def test_tables_claims_and_shares_are_the_studys(study: dict[str, Any], text: str) -> None:
    assert all(table in text for table in markdown([Row(**row) for row in study["rows"]]).split("\n\n"))
    assert claims_markdown(Claim(**claim) for claim in study["claims"]) in text
    found = {
        Kind(kind): {Estimator(estimator): share for estimator, share in by.items()}
        for kind, by in study["shares"].items()
    }
    assert shares_markdown(found) in text


def test_claims_that_do_not_hold_are_the_one_that_is_explained(study: dict[str, Any], text: str) -> None:
    refuted = [claim["claim"] for claim in study["claims"] if not claim["holds"]]
    assert refuted == ["4 threats: coverage-only does not depend on the number of hosts"]
    assert 'The one "no" is a matter of distance' in text


def test_every_assumption_is_listed_with_what_hangs_on_it(text: str) -> None:
    outcomes = [Outcome(**outcome) for outcome in stored("sensitivity.json")]
    assert [outcome.name for outcome in outcomes] == [variant.name for variant in variants()]
    assert "\n".join(table_line(outcome) for outcome in outcomes) in text
    stated = {"slowest_mps", "fastest_mps", "horizon_s", "safety_distance_m"}
    assert {outcome.varied for outcome in outcomes} - {""} == Assumptions().as_json().keys() - stated


def test_every_figure_is_in_the_gallery_with_what_the_letter_says_and_what_was_measured(gallery: str) -> None:
    sections = gallery.split("\n## ")[1:]
    assert len(sections) == len(figures.FIGURES)
    for name, section in zip(figures.FIGURES, sections, strict=True):
        assert f"(figures/{name}.svg)" in section
        assert "he letter" in section
        assert re.search("measured", section, re.IGNORECASE)
        for suffix in ("svg", "png"):
            assert (DOCS / "figures" / f"{name}.{suffix}").stat().st_size > 5000


def test_the_gallery_gives_the_studys_means(study: dict[str, Any], gallery: str) -> None:
    table = [Row(**row) for row in study["rows"]]
    ways = [
        (Kind.HSOP, Estimator.EQ5, 2),
        (Kind.COVERAGE_ONLY, Estimator.EQ5, 1),
        (Kind.RMS, Estimator.ML_ALL_VIEWS, 2),
    ]
    for kind, estimator, digits in ways:
        errors = [list(error_of(table, threats, kind, estimator).values()) for threats in (2, 3, 4)]
        first, second, third = (f"{sum(series) / len(series):.{digits}f}" for series in errors)
        assert f"{first}, {second} and {third} m" in gallery


def test_the_gallery_gives_fig_9_as_it_is_drawn(tmp_path: Path, gallery: str) -> None:
    pytest.importorskip("matplotlib")
    for line in figures.draw("fig09-static", tmp_path):
        panel, views, error = re.match(r"(\(.\)).*, (\d of 4) views central.* ([\d.]+ m)$", line).groups()  # type: ignore[union-attr]
        assert re.search(rf"^\| {re.escape(panel)}.*\| {views} \|.*\| {error} \|$", gallery, re.MULTILINE)
