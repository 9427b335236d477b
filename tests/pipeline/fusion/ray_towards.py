"""An object that the camera sees, and rays of a LiDAR towards it, for tests of existence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.fusion.existence import ExistenceState, weigh
from pipeline.params import ExistenceParams
from pipeline.types import F32, I32, U8, Frame, FusedObject, Ground, Point3
from tests.pipeline.build import fused, moment

PARAMS = ExistenceParams()
FRAME = Frame(0, "0", 0)
ROAD_M = -0.6
ROAD = Ground(np.zeros(0, bool), np.array([[0.0, 0.0, 1.0, -ROAD_M]]), np.array([0.0, 100.0]), np.ones(1, bool))


@dataclass(frozen=True)
class Rays:
    """The parts of a sweep that matter for rays."""

    points: F32
    ground: Ground | None = ROAD
    origin: Point3 = (0.0, 0.0, 0.0)
    cluster: int = -2
    """Cluster of every point; negative: none."""

    @property
    def kind(self) -> I32:
        return np.full(len(self.points), self.cluster, np.int32)

    @property
    def ring(self) -> U8:
        """Rays in which each height is a ring."""
        return np.unique(self.points[:, 2], return_inverse=True)[1].astype(np.uint8)


def returns(range_m: float, bearing_deg: float = 0.0, height_m: float = 0.6) -> F32:
    """Eleven rays in a fan of 2°, each ending at this range and height above the road."""
    turn = np.radians(bearing_deg + np.linspace(-1.0, 1.0, 11))
    z = np.full(11, ROAD_M + height_m)
    return np.stack([range_m * np.cos(turn), range_m * np.sin(turn), z, np.zeros(11)], axis=1).astype(np.float32)


NOTHING: F32 = np.zeros((0, 4), np.float32)


def camera_car(range_m: float = 12.0, sigma_m: float = 1.2, score: float = 0.8) -> FusedObject:
    return replace(fused(1, range_m, source="V"), distance_sigma_m=sigma_m, score=score)


def after(item: FusedObject, rays: Rays, frames: int = 5, params: ExistenceParams = PARAMS) -> FusedObject:
    state = ExistenceState()
    for k in range(frames):
        state, (found,) = weigh(state, (item,), rays, FRAME, moment(None, 0.1 if k else None), params)
    return found


def gate(item: FusedObject) -> bool | None:
    """Whether the ``free_road`` gate passed; None without the gate."""
    return next((each.passed for each in item.gates if each.name == "free_road"), None)
