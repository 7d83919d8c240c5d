"""OpenCV's own files come back as the lens that wrote them; anything else is refused by name."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from hsop_gcs.cameras.calibration import load_fisheye
from hsop_gcs.errors import BadInput

MATRIX = [[420.0, 0.0, 750.0], [0.0, 422.0, 748.0], [0.0, 0.0, 1.0]]
COEFFICIENTS = [0.02, -0.01, 0.003, -0.0005]


@pytest.mark.parametrize("suffix", ["yml", "json"])
def test_a_file_that_opencv_wrote_gives_its_lens(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"lens.{suffix}"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 1504)
    storage.write("image_height", 1504)
    storage.write("camera_matrix", np.array(MATRIX))
    storage.write("distortion_coefficients", np.array(COEFFICIENTS)[:, None])
    storage.release()
    lens = load_fisheye(path, sensor_width_mm=3.3)
    assert lens.focal_length_px == pytest.approx(421.0)
    assert lens.distortion == pytest.approx(tuple(COEFFICIENTS))
    assert lens.resolution_px == 1504


def test_plain_lists_are_understood(tmp_path: Path) -> None:
    path = tmp_path / "lens.json"
    path.write_text(json.dumps({"K": MATRIX, "D": COEFFICIENTS, "width": 1504}))
    assert load_fisheye(path).focal_length_px == pytest.approx(421.0)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"K": None}, "camera_matrix"),
        ({"K": [[1.0, 2.0]]}, "camera_matrix"),
        ({"K": [[400.0, 0, 750], [0, 500.0, 750], [0, 0, 1]]}, "focal lengths"),
        ({"D": [0.1, 0.2, 0.0, 0.0, 0.3]}, "four coefficients"),
        ({"D": [0.1, "x", 0.0, 0.0]}, "must be numbers"),
        ({"D": [0.1, float("nan"), 0.0, 0.0]}, "finite"),
        ({"D": [-1.0, 0.0, 0.0, 0.0]}, "distortion"),
        ({"width": 0}, "image_width"),
    ],
)
def test_a_file_that_is_no_fisheye_calibration_is_refused(
    tmp_path: Path, change: dict[str, object], named: str
) -> None:
    path = tmp_path / "lens.json"
    path.write_text(json.dumps({"K": MATRIX, "D": COEFFICIENTS, "width": 1504} | change))
    with pytest.raises(BadInput, match=named):
        load_fisheye(path)


def test_a_missing_file_and_a_broken_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.yml"):
        load_fisheye(tmp_path / "none.yml")
    (tmp_path / "broken.json").write_text('{"K": ')
    with pytest.raises(BadInput, match="not JSON"):
        load_fisheye(tmp_path / "broken.json")
