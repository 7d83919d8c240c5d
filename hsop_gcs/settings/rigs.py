"""The rigs of FLEET.toml: the fleet's, and those that hosts name."""

from dataclasses import replace
from typing import Annotated, Self

from pydantic import Field, model_validator

from hsop_gcs.cameras.calibration import load_fisheye
from hsop_gcs.cameras.fisheye import FisheyeCamera
from hsop_gcs.cameras.pinhole import PinholeCamera
from hsop_gcs.cameras.rig import CameraRig
from hsop_gcs.errors import BadInput
from hsop_gcs.settings.sections import Finite, Positive, Section, file_read_by

_LETTERS_RIG = CameraRig()
_FISHEYE, _CENTRAL = _LETTERS_RIG.peripheral, _LETTERS_RIG.central


class PeripheralSection(Section):
    focal_length_mm: Positive = _FISHEYE.focal_length_mm
    sensor_width_mm: Positive = _FISHEYE.sensor_width_mm
    resolution_px: Annotated[int, Field(gt=0)] = _FISHEYE.resolution_px
    distortion: tuple[Finite, Finite, Finite, Finite] = _FISHEYE.distortion
    min_pixels: Positive = _FISHEYE.min_pixels


class CentralSection(Section):
    focal_length_mm: Positive = _CENTRAL.focal_length_mm
    sensor_width_mm: Positive = _CENTRAL.sensor_width_mm
    resolution_px: Annotated[int, Field(gt=0)] = _CENTRAL.resolution_px
    fov_deg: Annotated[float, Field(gt=0, lt=180)] = _CENTRAL.fov_deg
    min_pixels: Positive = _CENTRAL.min_pixels


CalibrationFile = Annotated[FisheyeCamera, file_read_by(load_fisheye)]
"""The name of an OpenCV fisheye calibration, YAML or JSON; the lens it describes."""


class RigSection(Section):
    """A section that is missing from ``[rigs.NAME]`` is that of ``[rig]``, and from that the letter's."""

    peripheral: PeripheralSection | None = None
    calibration: CalibrationFile | None = None
    """Of the fisheyes: takes the place of all that ``peripheral`` says but ``min_pixels``."""
    central: CentralSection | None = None
    tilt_deg: tuple[Finite, Finite] | None = None
    pan_deg: tuple[Finite, Finite] | None = None
    """How far the central camera's gimbal tilts, and pans from the heading; None: as far as one can."""

    @model_validator(mode="after")
    def _some_camera(self) -> Self:
        if self.calibration is not None and self.peripheral is not None:
            known = self.peripheral.model_fields_set - {"min_pixels"}
            if known:
                raise ValueError(f"the calibration file says what peripheral.{min(known)} is")
        try:
            self.to_rig(_LETTERS_RIG)
        except BadInput as error:
            raise ValueError(str(error)) from error
        return self

    def to_rig(self, otherwise: CameraRig) -> CameraRig:
        """Return the rig, with the cameras of another where this section has none. Raises BadInput."""
        lens = otherwise.peripheral
        if self.calibration is not None:
            lens = replace(self.calibration, min_pixels=(self.peripheral or PeripheralSection()).min_pixels)
        elif self.peripheral is not None:
            lens = FisheyeCamera(**self.peripheral.model_dump())
        central = otherwise.central if self.central is None else PinholeCamera(**self.central.model_dump())
        return CameraRig(
            peripheral=lens,
            central=central,
            tilt_deg=self.tilt_deg or otherwise.tilt_deg,
            pan_deg=self.pan_deg or otherwise.pan_deg,
        )
