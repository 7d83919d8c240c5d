"""Calibrations of fisheye lenses as OpenCV writes them: ``cv2.FileStorage`` YAML, or JSON."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.errors import BadInput

MATRIX_NAMES = ("camera_matrix", "K", "cameraMatrix")
DISTORTION_NAMES = ("distortion_coefficients", "D", "dist_coeffs", "distCoeffs")
WIDTH_NAMES = ("image_width", "width")
MOST_UNEQUAL = 0.02
"""Part by which the two focal lengths may differ: the camera model has one."""


def load_fisheye(path: Path, *, sensor_width_mm: float = 3.3, min_pixels: float = 5.0) -> FisheyeCamera:
    """Read a lens from the camera matrix, the four distortion coefficients and the image width of a calibration file.

    sensor_width_mm: not part of a calibration; with it the focal length becomes millimetres. The mean of the two focal
    lengths is taken, and the boresight is put in the middle of the image: the principal point moves no detectable
    region. Raises BadInput naming the file and the entry.
    """
    entries = _entries(path)
    matrix = _array(path, entries, MATRIX_NAMES)
    if matrix.shape != (3, 3):
        raise BadInput(f"{path}: {MATRIX_NAMES[0]}", f"must be a 3 x 3 matrix, not {matrix.shape}")
    distortion = _array(path, entries, DISTORTION_NAMES).ravel()
    if distortion.size != 4:
        raise BadInput(
            f"{path}: {DISTORTION_NAMES[0]}",
            f"the fisheye model has four coefficients, not {distortion.size}; was this calibrated as a pinhole camera?",
        )
    width = float(_array(path, entries, WIDTH_NAMES).ravel()[0])
    if not (width > 0 and width == int(width)):
        raise BadInput(f"{path}: {WIDTH_NAMES[0]}", f"must be a whole number of pixels above 0, not {width!r}")
    across, up = float(matrix[0, 0]), float(matrix[1, 1])
    if not (across > 0 and up > 0 and abs(across - up) <= MOST_UNEQUAL * max(across, up)):
        raise BadInput(
            f"{path}: {MATRIX_NAMES[0]}",
            f"focal lengths must be above 0 and within {100 * MOST_UNEQUAL:g} %, not {across!r} and {up!r}",
        )
    k1, k2, k3, k4 = (float(k) for k in distortion)
    return FisheyeCamera(
        focal_length_mm=(across + up) / 2 * sensor_width_mm / width,
        sensor_width_mm=sensor_width_mm,
        resolution_px=int(width),
        distortion=(k1, k2, k3, k4),
        min_pixels=min_pixels,
    )


def _entries(path: Path) -> dict[str, Any]:
    """Return a file's top level: JSON values, or arrays and numbers of a YAML file."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise BadInput(str(path), error.strerror or str(error)) from None
    except UnicodeDecodeError as error:
        raise BadInput(str(path), f"not UTF-8 text: byte {error.start}") from None
    if text.lstrip().startswith("{"):
        try:
            content = json.loads(text)
        except ValueError as error:
            raise BadInput(str(path), f"not JSON: {error}") from None
        return dict(content)
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY | cv2.FILE_STORAGE_FORMAT_YAML)
    except cv2.error as error:
        raise BadInput(str(path), f"not an OpenCV YAML file: {error.err}") from None
    root = storage.root()
    return {name: _yaml_value(root.getNode(name)) for name in root.keys()}  # noqa: SIM118 - a FileNode is no mapping


def _yaml_value(node: Any) -> Any:
    if node.isMap():
        return node.mat()
    if node.isSeq():
        return [_yaml_value(node.at(k)) for k in range(node.size())]
    return node.real() if node.isReal() or node.isInt() else node.string()


def _array(path: Path, entries: dict[str, Any], names: tuple[str, ...]) -> npt.NDArray[np.float64]:
    for name in names:
        value = entries.get(name)
        if value is None:
            continue
        if isinstance(value, dict):
            value = np.reshape(value.get("data", ()), (int(value.get("rows", 0)), int(value.get("cols", 0))))
        try:
            array = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError):
            raise BadInput(f"{path}: {name}", f"must be numbers, not {value!r}") from None
        if array.size == 0 or not all(math.isfinite(number) for number in array.ravel()):
            raise BadInput(f"{path}: {name}", f"must be finite numbers, not {value!r}")
        return array
    raise BadInput(f"{path}: {names[0]}", f"missing; none of {', '.join(names)} is there")
