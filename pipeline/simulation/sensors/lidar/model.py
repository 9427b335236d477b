"""Mount and noise of the simulated LiDAR: the ``lidar`` part of a scenario file."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from pipeline.common.geometry import rotation
from pipeline.simulation.world.roads import ScenarioPart
from pipeline.types import F64


class LidarModel(ScenarioPart):
    """Mount relative to the ego origin, and noise. Points are in the level ego frame for any mount."""

    motion: bool = True
    """Each ray is cast at its own time, so moving objects are distorted as in a raw sweep."""
    range_sigma_m: float = Field(default=0.015, ge=0.0, le=0.5)
    """Standard deviation of the range."""
    dropout: float = Field(default=0.01, ge=0.0, le=1.0)
    """Share of returns lost at random."""
    up_m: float = Field(default=0.0, ge=-0.3, le=3.0)
    """Above the ego origin."""
    roll_deg: float = Field(default=0.0, ge=-10.0, le=10.0)
    """Positive leans right."""
    pitch_deg: float = Field(default=0.0, ge=-10.0, le=10.0)
    """Positive looks down."""
    yaw_deg: float = Field(default=0.0, ge=-10.0, le=10.0)
    """Positive looks left."""

    def mount(self) -> F64:
        """T_ego_lidar (4, 4)."""
        T = np.eye(4)
        T[:3, :3] = rotation(*(float(np.radians(angle)) for angle in (self.roll_deg, self.pitch_deg, self.yaw_deg)))
        T[2, 3] = self.up_m
        return T


VLP16 = LidarModel()
