"""A lane detector's points without a network: the road's true lane lines projected into the image, with noise.

The counterpart of ``truth_boxes`` for lines. Every line of the carriageway that the ego car drives on is seen up to
where paint is a few pixels wide; each point has its own sideways error, and some are missed. Vehicles do not hide paint
here.
"""

from __future__ import annotations

import numpy as np

from pipeline.alignment.projection import Pinhole
from pipeline.simulation.sensors.detection_model import LineNoise
from pipeline.simulation.world.roads import Road
from pipeline.simulation.world.world_state import LIDAR_HEIGHT_M, World
from pipeline.types import CameraCalibration, RawLanes

_FROM_M, _STEP_M = 4.0, 0.5


def lane_points(now: World, road: Road, camera: CameraCalibration, noise: LineNoise, seed: int, index: int) -> RawLanes:
    """The points of one moment. The same seed, index and world give the same points."""
    rng = np.random.default_rng([seed, 10, index])
    alignment = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    along = now.s_m + np.arange(_FROM_M, noise.reach_m * 1.2, _STEP_M)
    found, lines = [np.zeros((0, 2))], [np.zeros(0, int)]
    painted_m = sorted(road.lane_lines_m()[0]) if road.painted else []
    for number, d_m in enumerate(painted_m):
        places = now.to_ego(road.to_world(along, d_m))
        near = (
            (places[:, 0] > _FROM_M) & (np.hypot(*places.T) < noise.reach_m) & (rng.random(len(places)) > noise.missed)
        )
        pixels = alignment.project(np.column_stack([places[near], np.full(near.sum(), -LIDAR_HEIGHT_M)]))
        pixels[:, 0] += noise.sigma_px * rng.standard_normal(len(pixels))
        inside = np.all((pixels >= 0.0) & (pixels < (camera.width, camera.height)), axis=1)
        found.append(pixels[inside])
        lines.append(np.full(int(inside.sum()), number))
    points = np.vstack(found).astype(np.float32)
    return RawLanes("truth", points, np.full(len(points), 0.9, np.float32), np.concatenate(lines).astype(np.int32))
