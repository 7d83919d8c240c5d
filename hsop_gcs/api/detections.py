"""Detections as they arrive: one or many, each judged by itself, in the words of the reports' intake."""

from collections.abc import Callable, Sequence
from itertools import islice
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hsop_gcs.api.bodies import MAX_FIELDS, Pace, counted, field_paths, has_too_many_fields, one_or_many
from hsop_gcs.api.problems import fault_of, faults_of
from hsop_gcs.api.schemas import FieldFault, Number, UtcTime
from hsop_gcs.cameras.rig import PIXEL_NOISE_PX, CameraKind
from hsop_gcs.detections import Detection, Direction, Fate, Lens, Pixel, Verdict
from hsop_gcs.detections.detection import SIGMA_DEG
from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import Fleet


class _Request(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PixelIn(_Request):
    """A place in the image, from the centre of its top left pixel; u right, v down."""

    u_px: Annotated[Number, Field(ge=-1e5, le=1e5)]
    v_px: Annotated[Number, Field(ge=-1e5, le=1e5)]
    sigma_px: (
        Annotated[
            Number,
            Field(ge=0.1, le=500, description="standard deviation of each axis; by default 30 peripheral, 3 central"),
        ]
        | None
    ) = None


class BearingIn(_Request):
    """A direction in the earth's frame."""

    azimuth_deg: Annotated[Number, Field(ge=0, le=360, description="compass degrees, clockwise from north")]
    elevation_deg: Annotated[Number, Field(ge=-90, le=90, description="up from the horizon")]
    sigma_deg: Annotated[Number, Field(ge=0.01, le=45, description="standard deviation across it")] = SIGMA_DEG


class DetectionIn(_Request):
    """What one camera of one host saw at one time: a pixel or a bearing."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "host": "h1",
                    "camera": "peripheral",
                    "lens": "front",
                    "time": "2026-11-22T10:00:00.250Z",
                    "pixel": {"u_px": 812.4, "v_px": 733.0},
                },
                {
                    "host": "h2",
                    "camera": "central",
                    "time": "2026-11-22T10:00:00.250Z",
                    "bearing": {"azimuth_deg": 41.0, "elevation_deg": -3.0, "sigma_deg": 0.5},
                    "threat_id": "t1",
                },
            ]
        }
    )

    host: Annotated[str, Field(min_length=1, max_length=64)]
    camera: CameraKind
    lens: Annotated[
        Lens | None,
        Field(description="of the peripheral camera: front is the fisheye on the heading; needed with a pixel"),
    ] = None
    time: Annotated[UtcTime, Field(description="when the image was exposed")]
    pixel: PixelIn | None = None
    bearing: BearingIn | None = None
    threat_id: Annotated[
        str | None, Field(min_length=1, max_length=64, description="the id under which GET /threats shows it")
    ] = None


class DetectionResult(BaseModel):
    index: int
    status: Literal["accepted", "rejected"]
    fate: Fate
    threat: str | None = None
    errors: list[FieldFault] = []


class DetectionResults(BaseModel):
    accepted: int
    rejected: int
    results: list[DetectionResult]


Submit = Callable[[Sequence[Detection]], Sequence[Verdict]]
"""Takes detections into the picture; a verdict on each, in their order."""


_TOGETHER = 200
"""Detections of one body that are looked at together; more would stop everything else for too long."""
_FIELDS = field_paths(DetectionIn)


async def take(
    body: bytes, fleet: Fleet, submit: Submit, refuse: Callable[[str], None], pace: Pace
) -> DetectionResults:
    """Judge one detection (an object) or many (an array).

    Raises NotJson; BadInput if it is neither, or too many. ``refuse`` is told the field of each that cannot be read.
    """
    judged: list[Detection | DetectionResult] = []
    for index, each in enumerate(await one_or_many(body, "detection", pace)):
        judged.append(read(index, each, fleet))
        await pace.breathe()
    for result in judged:
        if isinstance(result, DetectionResult):
            refuse(counted(result.errors[0].field, _FIELDS))
    readable = iter([each for each in judged if isinstance(each, Detection)])
    verdicts: list[Verdict] = []
    while together := list(islice(readable, _TOGETHER)):
        verdicts += submit(together)
        await pace.breathe()
    rest = iter(verdicts)
    results = [_result(index, next(rest)) if isinstance(each, Detection) else each for index, each in enumerate(judged)]
    accepted = sum(result.status == "accepted" for result in results)
    return DetectionResults(accepted=accepted, rejected=len(results) - accepted, results=results)


def read(index: int, raw: Any, fleet: Fleet) -> Detection | DetectionResult:
    """Return the detection, or why it is none."""
    try:
        if has_too_many_fields(raw):
            raise BadInput("body", f"a detection with more than {MAX_FIELDS} fields")
        return to_detection(DetectionIn.model_validate(raw), fleet)
    except ValidationError as error:
        return _rejected(index, [FieldFault(**fault) for fault in faults_of(error.errors(include_url=False))])
    except BadInput as error:
        return _rejected(index, [FieldFault(**fault_of(error))])


def to_detection(given: DetectionIn, fleet: Fleet) -> Detection:
    """Return the detection with what it leaves open filled in. Raises BadInput for parts that do not go together."""
    hosts = [host.id for host in fleet.hosts]
    if given.host not in hosts:
        raise BadInput("host", f"{given.host!r} is not in the fleet ({', '.join(hosts)})")
    if given.camera is CameraKind.CENTRAL and given.lens is not None:
        raise BadInput("lens", f"the central camera has one lens only (given: {str(given.lens)!r})")
    return Detection(
        host=given.host,
        camera=given.camera,
        lens=given.lens,
        time_s=given.time.timestamp(),
        seen=_seen(given),
        threat_id=given.threat_id,
    )


def _seen(given: DetectionIn) -> Pixel | Direction:
    if given.pixel is not None and given.bearing is not None:
        raise BadInput("bearing", "a detection is a pixel or a bearing, not both")
    if given.bearing is not None:
        return Direction(**given.bearing.model_dump())
    if given.pixel is None:
        raise BadInput("pixel", "needed, as there is no bearing")
    if given.camera is CameraKind.PERIPHERAL and given.lens is None:
        raise BadInput("lens", "needed with a pixel of the peripheral camera: front or back")
    sigma_px = given.pixel.sigma_px or PIXEL_NOISE_PX[given.camera]
    return Pixel(u_px=given.pixel.u_px, v_px=given.pixel.v_px, sigma_px=sigma_px)


def _result(index: int, verdict: Verdict) -> DetectionResult:
    if verdict.refusal is not None:
        return _rejected(index, [FieldFault(field=verdict.refusal.field, problem=verdict.refusal.problem)])
    return DetectionResult(index=index, status="accepted", fate=verdict.fate, threat=verdict.threat)


def _rejected(index: int, faults: list[FieldFault]) -> DetectionResult:
    return DetectionResult(index=index, status="rejected", fate=Fate.REFUSED, errors=faults)
