"""Validated shapes in requests of a page: values that no label could have are rejected."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from pipeline.common.geometry import Cuboid
from pipeline.labels.validate import FARTHEST_M, LARGEST_SIDE_M, LARGEST_YAW_RAD

Finite = Annotated[float, Field(gt=-FARTHEST_M, lt=FARTHEST_M, allow_inf_nan=False)]
Meters = Annotated[float, Field(gt=0.0, le=LARGEST_SIDE_M, allow_inf_nan=False)]


class CuboidShape(BaseModel):
    """A cuboid in the ego frame, metres."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    center: tuple[Finite, Finite, Finite]
    """x y z of its centre."""
    size: tuple[Meters, Meters, Meters]
    """Length, width, height."""
    yaw_rad: Annotated[float, Field(gt=-LARGEST_YAW_RAD, lt=LARGEST_YAW_RAD, allow_inf_nan=False)]
    """Angle of the length axis from ego x, positive to the left."""

    def value(self) -> Cuboid:
        return Cuboid(self.center, self.size, self.yaw_rad)
