"""What a page sends of shapes."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, FiniteFloat

from pipeline.geometry import Cuboid


class GivenCuboid(BaseModel):
    """Ego frame, metres: centre x y z, length width height, heading in radians."""

    model_config = ConfigDict(extra="forbid")

    center: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    size: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    yaw_rad: FiniteFloat

    def value(self) -> Cuboid:
        return Cuboid(self.center, self.size, self.yaw_rad)
