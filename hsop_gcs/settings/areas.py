"""The fence and the keep-out areas of FLEET.toml, written there or in files beside it."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from hsop_gcs.areas import Area, read_areas
from hsop_gcs.errors import BadInput
from hsop_gcs.placement.airspace import require_area
from hsop_gcs.settings.sections import Finite, Section, file_read_by


def _an_area(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    try:
        require_area(corners, "polygon")
    except BadInput as error:
        raise ValueError(error.problem) from error
    return corners


Corner = tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]]
"""Latitude and longitude, degrees."""
Corners = Annotated[tuple[Corner, ...], Field(min_length=3), AfterValidator(_an_area)]


def _load(path: Path) -> tuple[Area, ...]:
    areas = read_areas(path)
    for area in areas:
        require_area(area.corners, str(path))
    return areas


AreaFile = Annotated[tuple[Area, ...], file_read_by(_load)]
"""The name of a GeoJSON, QGroundControl .plan or KML file; what it holds."""


class FenceSection(Section):
    inside: Corners | None = None
    file: AreaFile | None = None
    """Its exclusions are keep-outs."""

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if (self.inside is None) == (self.file is None):
            raise ValueError("needs inside or file, one of them")
        if self.file is not None and all(area.keep_out for area in self.file):
            raise ValueError("file: holds exclusions only, nothing to be inside of")
        return self

    def areas(self) -> tuple[Area, ...]:
        """Return what hosts must stay in, and keep-outs of the same file."""
        return self.file or (Area(corners=self.inside or ()),)


class KeepOutSection(Section):
    polygon: Corners | None = None
    file: AreaFile | None = None
    floor_m: Finite | None = None
    ceiling_m: Finite | None = None
    """Metres above the origin, like those of the flight limits; None: what the file says, or without end."""

    @model_validator(mode="after")
    def _somewhere(self) -> Self:
        if (self.polygon is None) == (self.file is None):
            raise ValueError("needs polygon or file, one of them")
        for area in self.areas():
            floor_m, ceiling_m = area.floor_m, area.ceiling_m
            if floor_m is not None and ceiling_m is not None and floor_m >= ceiling_m:
                raise ValueError(f"floor_m {floor_m:g} must be below ceiling_m {ceiling_m:g}")
        if self.file is not None and any(area.keep_out is False for area in self.file):
            raise ValueError("file: holds inclusions; they belong into [fence]")
        return self

    def areas(self) -> tuple[Area, ...]:
        """Return what hosts must stay out of."""
        return tuple(
            replace(
                area,
                floor_m=area.floor_m if self.floor_m is None else self.floor_m,
                ceiling_m=area.ceiling_m if self.ceiling_m is None else self.ceiling_m,
            )
            for area in self.file or (Area(corners=self.polygon or ()),)
        )
