"""Reports as they arrive: one or many, each judged by itself, so that one bad report never costs a good one."""

from itertools import islice
from typing import Any

from pydantic import ValidationError

from hsop_gcs.api.bodies import MAX_FIELDS, Pace, counted, field_paths, has_too_many_fields, one_or_many
from hsop_gcs.api.problems import fault_of, faults_of
from hsop_gcs.api.schemas import LONGEST_NAME, FieldFault, ReportIn, ReportResult, ReportResults
from hsop_gcs.errors import BadInput
from hsop_gcs.mission.controller import Mission
from hsop_gcs.reports import Report, ReportRules, Site, locate
from hsop_gcs.tracks import Verdict

_TOGETHER = 200
"""Reports of one body that are given to the tracker at a time; more would stop everything else for too long."""
_PAIRS = 5_000
"""Pairs of a report and a track that are given to the tracker at a time: at worst each report lies in every gate."""
_FIELDS = field_paths(ReportIn)


async def take(body: bytes, mission: Mission, pace: Pace) -> ReportResults:
    """Judge one report (an object) or many (an array).

    Raises NotJson; BadInput if it is neither, or too many.
    """
    judged: list[Report | ReportResult] = []
    for index, each in enumerate(await one_or_many(body, "report", pace)):
        judged.append(_read(index, each, mission))
        await pace.breathe()
    readable = iter([each for each in judged if isinstance(each, Report)])
    verdicts: list[Verdict] = []
    while together := list(islice(readable, _together(mission))):
        verdicts += mission.submit(together)
        await pace.breathe()
    rest = iter(verdicts)
    results = [_result(index, next(rest)) if isinstance(each, Report) else each for index, each in enumerate(judged)]
    accepted = sum(result.status == "accepted" for result in results)
    return ReportResults(accepted=accepted, rejected=len(results) - accepted, results=results)


def _together(mission: Mission) -> int:
    return max(1, min(_TOGETHER, _PAIRS // (len(mission.state.picture.tracks) + 1)))


def _read(index: int, raw: Any, mission: Mission) -> Report | ReportResult:
    """Return the report, or why it is none."""
    try:
        if has_too_many_fields(raw):
            raise BadInput("body", f"a report with more than {MAX_FIELDS} fields")
        return to_report(ReportIn.model_validate(raw), mission.site, mission.state.rules.reports)
    except ValidationError as error:
        faults = faults_of(error.errors(include_url=False))
        mission.refuse_report(counted(faults[0]["field"], _FIELDS), faults[0]["problem"], source=_source(raw))
        return ReportResult(index=index, status="rejected", errors=[FieldFault(**fault) for fault in faults])
    except BadInput as error:
        mission.refuse_report(error.field, error.problem, source=_source(raw))
        return _rejected(index, error)


def _source(raw: Any) -> str | None:
    """Return who sent a report that is refused, if it can be told."""
    name = raw.get("source") if isinstance(raw, dict) else None
    return name if isinstance(name, str) and 0 < len(name) <= LONGEST_NAME and name.isprintable() else None


def _result(index: int, verdict: Verdict) -> ReportResult:
    if isinstance(verdict, BadInput):
        return _rejected(index, verdict)
    return ReportResult(index=index, status="accepted", threat=verdict)


def _rejected(index: int, error: BadInput) -> ReportResult:
    return ReportResult(index=index, status="rejected", errors=[FieldFault(**fault_of(error))])


def to_report(given: ReportIn, site: Site, rules: ReportRules) -> Report:
    """Return the report in the local frame. Raises BadInput for a place or a datum that cannot be used."""
    position = given.position
    velocity = given.velocity
    return Report(
        source=given.source,
        threat_id=given.threat_id,
        time_s=given.time.timestamp(),
        position_m=locate(
            position.lat_deg, position.lon_deg, position.altitude_m, position.altitude_datum, site, rules
        ),
        velocity_mps=None if velocity is None else (velocity.east_mps, velocity.north_mps, velocity.up_mps),
        size_m=given.size_m,
        sigma_m=given.sigma_m,
    )
