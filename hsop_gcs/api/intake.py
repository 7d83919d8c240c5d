"""Reports as they arrive: one or many, each judged by itself, so that one bad report never costs a good one."""

import json
from typing import Any

from pydantic import ValidationError

from hsop_gcs.api.problems import faults_of
from hsop_gcs.api.schemas import LONGEST_NAME, FieldFault, ReportIn, ReportResult, ReportResults
from hsop_gcs.errors import BadInput
from hsop_gcs.mission.controller import Mission
from hsop_gcs.reports import Report, ReportRules, Site, locate
from hsop_gcs.tracks import Verdict

MAX_AT_ONCE = 1000


def parse_json(body: bytes) -> Any:
    """Return the parsed body. Raises BadInput that says where the JSON ends being JSON."""
    try:
        return json.loads(body)
    except json.JSONDecodeError as error:
        raise BadInput("body", f"not JSON: {error.msg} at line {error.lineno} column {error.colno}") from error
    except (ValueError, RecursionError) as error:  # no UTF-8; a number of thousands of digits; nested too deeply
        raise BadInput("body", f"not JSON: {error}") from error


def one_or_many(raw: Any, what: str) -> list[Any]:
    """Return what a body holds, an object or an array of them. Raises BadInput if it is neither, or too many."""
    if not isinstance(raw, dict | list):
        raise BadInput("body", f"must be a {what} or an array of {what}s")
    items = raw if isinstance(raw, list) else [raw]
    if not 1 <= len(items) <= MAX_AT_ONCE:
        raise BadInput("body", f"{len(items)} {what}s; 1 to {MAX_AT_ONCE} are taken at once")
    return items


def take(raw: Any, mission: Mission) -> ReportResults:
    """Judge one report (an object) or many (an array). Raises BadInput if it is neither, or too many."""
    judged = [_read(index, each, mission) for index, each in enumerate(one_or_many(raw, "report"))]
    readable = [each for each in judged if isinstance(each, Report)]
    verdicts = iter(mission.submit(readable) if readable else ())
    results = [
        _result(index, next(verdicts)) if isinstance(each, Report) else each for index, each in enumerate(judged)
    ]
    accepted = sum(result.status == "accepted" for result in results)
    return ReportResults(accepted=accepted, rejected=len(results) - accepted, results=results)


def _read(index: int, raw: Any, mission: Mission) -> Report | ReportResult:
    """Return the report, or why it is none."""
    try:
        return to_report(ReportIn.model_validate(raw), mission.site, mission.state.rules.reports)
    except ValidationError as error:
        faults = faults_of(error.errors())
        mission.refuse_report(**faults[0], source=_source(raw))
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
    return ReportResult(index=index, status="rejected", errors=[FieldFault(field=error.field, problem=error.problem)])


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
