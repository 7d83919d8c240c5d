"""What POST /api/v1/detections takes: each detection judged by itself, every fault named with its field."""

import asyncio
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

import pytest

from hsop_gcs.api.bodies import Pace
from hsop_gcs.api.detections import DetectionIn, DetectionResults, take
from hsop_gcs.cameras.rig import CameraKind
from hsop_gcs.detections import Detection, Direction, Fate, Lens, Pixel, Refused, Verdict
from hsop_gcs.errors import BadInput
from hsop_gcs.fleet import Fleet, Host
from hsop_gcs.simulator.eyes import to_json

FLEET = Fleet(hosts=tuple(Host(id=f"h{n}", system_id=n, connection="udpin:127.0.0.1:0") for n in (1, 2)))
TIME_S = 1_800_000_000.25


def detection(**changes: Any) -> dict[str, Any]:
    """A good detection by a front fisheye, with fields replaced; None leaves a field out."""
    good = {
        "host": "h1",
        "camera": "peripheral",
        "lens": "front",
        "time": datetime.fromtimestamp(TIME_S, UTC).isoformat(),
        "pixel": {"u_px": 812.5, "v_px": 733.0},
    }
    return {name: value for name, value in (good | changes).items() if value is not None}


class Service:
    """Takes every detection as a bearing of t1, but refuses those of host h2."""

    def __init__(self) -> None:
        self.taken: list[Detection] = []
        self.refused: list[str] = []

    def submit(self, detections: Sequence[Detection]) -> list[Verdict]:
        self.taken += detections
        return [
            Verdict(fate=Fate.REFUSED, refusal=Refused(reason="no pose", field="time", problem="never heard"))
            if each.host == "h2"
            else Verdict(fate=Fate.BEARING, threat="t1")
            for each in detections
        ]

    def post(self, raw: Any) -> DetectionResults:
        return asyncio.run(
            take(json.dumps(raw).encode(), FLEET, self.submit, self.refused.append, Pace(asyncio.Lock()))
        )


def test_a_pixel_gets_the_sigma_of_its_camera_unless_it_brings_its_own() -> None:
    service = Service()
    service.post(
        [
            detection(),
            detection(camera="central", lens=None),
            detection(pixel={"u_px": 1.0, "v_px": 2.0, "sigma_px": 7.5}),
        ]
    )
    assert [each.seen for each in service.taken] == [
        Pixel(u_px=812.5, v_px=733.0, sigma_px=30.0),
        Pixel(u_px=812.5, v_px=733.0, sigma_px=3.0),
        Pixel(u_px=1.0, v_px=2.0, sigma_px=7.5),
    ]
    first = service.taken[0]
    assert (first.host, first.camera, first.lens, first.time_s) == ("h1", CameraKind.PERIPHERAL, Lens.FRONT, TIME_S)


def test_a_bearing_needs_no_lens_and_is_three_degrees_good_unless_it_says_otherwise() -> None:
    service = Service()
    service.post(detection(lens=None, pixel=None, bearing={"azimuth_deg": 359.5, "elevation_deg": -3}))
    assert service.taken[0].seen == Direction(azimuth_deg=359.5, elevation_deg=-3.0, sigma_deg=3.0)


def test_a_bad_detection_among_good_ones_costs_only_itself() -> None:
    service = Service()
    results = service.post([detection(), detection(camera="radar"), detection(host="h2"), 5, detection(host="h1")])
    assert (results.accepted, results.rejected) == (2, 3)
    assert [each.index for each in results.results] == [0, 1, 2, 3, 4]
    assert [each.fate for each in results.results] == [Fate.BEARING, *[Fate.REFUSED] * 3, Fate.BEARING]
    assert results.results[0].threat == "t1"
    assert results.results[2].errors[0].field == "time"
    assert service.refused == ["camera", "body"], "what the tracker refuses, it counts itself"


@pytest.mark.parametrize(
    ("change", "field", "shown"),
    [
        ({"host": "h9"}, "host", "'h9' is not in the fleet (h1, h2)"),
        ({"host": ""}, "host", "''"),
        ({"camera": "infrared"}, "camera", "infrared"),
        ({"lens": "left"}, "lens", "left"),
        ({"lens": None}, "lens", "front or back"),
        ({"camera": "central"}, "lens", "front"),
        ({"time": "2026-01-31T12:00:00"}, "time", "2026-01-31T12:00:00"),
        ({"time": 5}, "time", "RFC 3339"),
        ({"pixel": None}, "pixel", "no bearing"),
        ({"pixel": {"u_px": "812", "v_px": 3.0}}, "pixel.u_px", "812"),
        ({"pixel": {"u_px": float("nan"), "v_px": 3.0}}, "pixel.u_px", "nan"),
        ({"pixel": {"u_px": 1.0, "v_px": 3.0, "sigma_px": 0}}, "pixel.sigma_px", "0"),
        ({"bearing": {"azimuth_deg": 1.0, "elevation_deg": 2.0}}, "bearing", "not both"),
        ({"pixel": None, "bearing": {"azimuth_deg": 400, "elevation_deg": 2}}, "bearing.azimuth_deg", "400"),
        ({"pixel": None, "bearing": {"azimuth_deg": 4, "elevation_deg": -91}}, "bearing.elevation_deg", "-91"),
        ({"threat_id": ""}, "threat_id", "''"),
        ({"colour": "red"}, "colour", "red"),
    ],
)
def test_a_fault_is_answered_with_its_field_and_value(change: dict[str, Any], field: str, shown: str) -> None:
    service = Service()
    (result,) = service.post(detection(**change)).results
    assert (result.status, result.errors[0].field) == ("rejected", field)
    assert shown in result.errors[0].problem
    assert service.taken == []
    assert service.refused == ["unknown field" if field == "colour" else field]


@pytest.mark.parametrize("raw", [3, None, "detection", [], [{}] * 1001])
def test_what_is_no_detection_and_no_list_of_them_is_refused(raw: Any) -> None:
    with pytest.raises(BadInput, match="body"):
        Service().post(raw)


@pytest.mark.parametrize("example", DetectionIn.model_json_schema()["examples"])
def test_the_examples_of_the_schema_are_taken(example: dict[str, Any]) -> None:
    service = Service()
    service.post(example)
    assert len(service.taken) == 1


@pytest.mark.parametrize(
    "seen", [Pixel(u_px=1.25, v_px=2.5, sigma_px=3.0), Direction(azimuth_deg=5.0, elevation_deg=6.0, sigma_deg=0.5)]
)
def test_what_the_simulator_sends_arrives_unchanged(seen: Pixel | Direction) -> None:
    sent = Detection(host="h1", camera=CameraKind.CENTRAL, time_s=TIME_S, seen=seen, threat_id="t1")
    service = Service()
    service.post(to_json(sent))
    assert service.taken == [sent]
