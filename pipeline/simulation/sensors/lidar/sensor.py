"""A ray-cast VLP-16: every ray at its own time, with range noise and lost returns.

Whether a return is strong enough to be detected is random, with a probability that falls off with range: a surface of
reflectance ρ, hit at an angle θ from its normal, returns a power proportional to ρ·cos θ/R², so the range at which it
is lost is proportional to √(ρ·cos θ). The reach of each material is set to match real VLP-16 sweeps: five points or
more on the car ahead in 90 % at 20–30 m, 46 % at 30–40 m, 17 % at 40–50 m, hardly any beyond; the road only where it is
hit steeply.

Compared with the real sweeps (tests/accuracy/test_lidar_realism.py writes the table), points and rings on a car agree
within their spread from 10 to 40 m. Nearer, where there are only three sightings of one car, a simulated car has a
sixth more points on as many rings. Beyond 40 m it has too few: real cars keep 2 to 9 points on one ring up to 70 m,
simulated ones hardly any, so the simulator's figures for LiDAR range are conservative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.simulation.sensors.lidar.model import VLP16, LidarModel
from pipeline.simulation.sensors.lidar.rays import CHANNELS, COLUMNS_PER_RAD, cast, directions, firing_times_s
from pipeline.simulation.sensors.lidar.scene import MATERIALS, MAX_RANGE_M, ROAD, scene_boxes
from pipeline.simulation.world.roadside import Roadside
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, World
from pipeline.types import F32, F64, I64, Sweep


@dataclass(frozen=True)
class _Beams:
    """Rays of one mount in ego axes, their origin, and by how many columns the mount rotates them."""

    rays: F64
    start: F64
    spare: int


class Lidar:
    """A VLP-16 as it is mounted; T_ego_lidar: (4, 4), by default the model's own."""

    def __init__(self, model: LidarModel = VLP16, T_ego_lidar: F64 | None = None) -> None:
        T = model.mount() if T_ego_lidar is None else T_ego_lidar
        straight = directions()
        rays = np.ascontiguousarray(straight @ T[:3, :3].T)
        swing = np.arctan2(rays[..., 1], rays[..., 0]) - np.arctan2(straight[..., 1], straight[..., 0])
        turned = np.abs((swing + np.pi) % (2 * np.pi) - np.pi).max()
        self._model = model
        self._beams = _Beams(rays, T[:3, 3].copy(), int(np.ceil(turned * COLUMNS_PER_RAD)))
        self._times_s = firing_times_s().mean(axis=1) if model.motion else np.zeros(len(rays))

    def sweep(self, world: World, roadside: Roadside, seed: int, index: int, t_ns: int) -> Sweep:
        """The sweep of one moment, ego frame. The same seed and index give the same points."""
        road = np.array([-LIDAR_HEIGHT_M, 0.0, 0.0, -world.hump_per_m])
        return self.sweep_of(scene_boxes(world, roadside), road, np.random.default_rng([seed, 2, index]), t_ns)

    def sweep_of(self, boxes: F64, ground: F64, rng: np.random.Generator, t_ns: int) -> Sweep:
        """The sweep of (B, 13) boxes of the ego frame on z = ground[0] + ground[1]·x + ground[2]·y + ground[3]·x²/2."""
        x, y, z = self._beams.start
        shifted = boxes.copy()
        shifted[:, :3] -= self._beams.start
        height, slope, cross, bend = ground
        below = np.array([height + (slope + bend * x / 2.0) * x + cross * y - z, slope + bend * x, cross, bend])
        range_m, met, cosine = cast(self._beams.rays, self._times_s, shifted, below, self._beams.spare)
        return self._returns(range_m, met, cosine, boxes, rng, t_ns)

    def _returns(self, range_m: F64, met: I64, cosine: F64, boxes: F64, rng: np.random.Generator, t_ns: int) -> Sweep:
        """The points of the rays that return: strong enough, with range noise."""
        shape = range_m.shape
        chance, noise = rng.random(shape, dtype=np.float32), rng.standard_normal(shape, dtype=np.float32)
        column, ring = np.nonzero(range_m < MAX_RANGE_M)
        far, box = range_m[column, ring], met[column, ring]
        material = np.append(boxes[:, 8], ROAD).astype(np.intp)[box]  # −1, the ground, is the last
        reach = np.append(boxes[:, 12], 1.0)[box]
        intensity, half_range_m, fall_off_m, rough_m, share = MATERIALS[material].T
        half_range_m = half_range_m * reach * np.sqrt(cosine[column, ring])
        returned = (1.0 - self._model.dropout) * share / (1.0 + np.exp((far - half_range_m) / fall_off_m))
        kept = chance[column, ring] < returned
        column, ring = column[kept], ring[kept]
        scatter = noise[column, ring]
        measured = far[kept] + scatter * np.hypot(self._model.range_sigma_m, rough_m[kept])
        points: F32 = np.empty((len(column), 4), dtype=np.float32)
        points[:, :3] = self._beams.start + self._beams.rays[column, ring] * measured[:, None]
        points[:, 3] = np.clip(intensity[kept] * reach[kept] ** 2 * (1.0 + 0.1 * scatter), 0.0, 255.0)
        return Sweep(t_ns, points, ring.astype(np.uint8), CHANNELS, self._times_s[column].astype(np.float32))
