"""Has the camera or the LiDAR been knocked? What both see of the same vehicles tells by which angle.

A vehicle's cuboid, projected, should lie on its box. Where it lies beside it, the two mounts are not turned to each
other as the calibration says. Single boxes are off by much, and by the same in every frame: a detector that draws one
car too wide goes on doing so. So each vehicle counts once, by the mean over its frames, with the deviation that such
means have; and angles are told only when the vehicles of the last seconds together leave little doubt.

Not told by it: a wrong distance law, which moves no box, and a road that bends, which moves both. A wrong time between
the sensors turns vehicles that cross one way and those that come from the other side the other way.
"""

from __future__ import annotations

from math import atan2, degrees, hypot
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.geometry import Cuboid
from pipeline.fusion.fuse import Fusion
from pipeline.params import FusionParams
from pipeline.types import F64, VEHICLES, Box, FusedObject

BORDER_PX = 3.0
"""A box that ends this close to the image's border is cut."""
LIKE_WIDTH = 0.35
"""A cluster whose width differs from its box's by a larger share is a part of the vehicle, or more than it."""
NEAREST_M, FARTHEST_M = 5.0, 40.0
"""Nearer, the two mounts see different sides of a car; farther, one or two rings are on it."""
LASTING_SHARE = 0.06
"""By how much of its height a box's middle or foot is off as long as the vehicle is seen (1 σ)."""
LASTING_DEG = 0.12
"""The same of a cluster whose sides lie between beams 0.2° to 0.4° apart."""
FRAME_SHARE = 0.08
"""By how much more in one frame."""
SMALLEST_DEG = 0.4
"""Smaller angles move a car 30 m away by about a tenth of its width: fusion does without them."""
FEWEST_FRAMES, FEWEST_VEHICLES = 5, 4
"""A vehicle counts once it has been seen for half a second at 10 Hz; of three vehicles two may be wrong pairs."""
MEDIAN_LOSS = 1.25
"""Standard deviation of a median against that of a mean."""


class Sighting(NamedTuple):
    """How far one vehicle's cuboid has lain from its box."""

    id: int
    t_ns: int
    """The last frame of both."""
    frames: int
    yaw_deg: float
    """Mean over the frames; the turn of the camera to the left that puts one on the other."""
    pitch_deg: float
    """The same downwards."""
    height_deg: float
    """Of the box, mean over the frames."""


class Drift(NamedTuple):
    """By how much the camera is turned against what its calibration says."""

    yaw_deg: float
    """To the left."""
    pitch_deg: float
    """Downwards."""
    yaw_sigma_deg: float
    """Standard deviation of ``yaw_deg``."""
    pitch_sigma_deg: float
    """Standard deviation of ``pitch_deg``."""
    vehicles: int
    """That say so."""

    @property
    def note(self) -> str:
        """For people, with what to do."""
        yaw = f"yaw {self.yaw_deg:+.1f}° ± {self.yaw_sigma_deg:.1f}°"
        pitch = f"pitch {self.pitch_deg:+.1f}° ± {self.pitch_sigma_deg:.1f}°"
        who = f"judging by {self.vehicles} vehicles"
        return f"Camera or LiDAR has turned, {who}: {yaw}, {pitch}. Check with Align, then Fit."


class DriftState(NamedTuple):
    """The vehicles of the last seconds."""

    sightings: tuple[Sighting, ...] = ()


def follow(
    state: DriftState,
    fused: Fusion,
    aligned: Alignment | None,
    picture_size: tuple[int, int] | None,
    t_ns: int,
    params: FusionParams,
) -> tuple[DriftState, Drift | None]:
    """The state after this frame, and the angles that it leaves little doubt of; None while there is no such doubt."""
    if aligned is None or picture_size is None:
        return DriftState(), None
    # Each vehicle tells the angle between its box and its projected cuboid; those of the last seconds judge together
    known = {each.id: each for each in state.sightings if t_ns - each.t_ns <= params.drift_s * 1e9}
    for item in fused.objects:
        box = fused.vision_boxes.get(item.id)
        if box is not None and _tells(item, box, picture_size):
            assert item.cuboid is not None
            found = _angles(item.cuboid, box, aligned)
            if found is not None:
                known[item.id] = _with(known.get(item.id), item.id, t_ns, found)
    sightings = tuple(known.values())
    return DriftState(sightings), judge(sightings, params)


def judge(sightings: tuple[Sighting, ...], params: FusionParams) -> Drift | None:
    """The angles of all sightings together, if they are surely not zero."""
    steady = [each for each in sightings if each.frames >= FEWEST_FRAMES]
    if len(steady) < FEWEST_VEHICLES:
        return None
    sigmas_deg = np.array([_sigma_deg(each) for each in steady])
    yaw_deg, yaw_sigma_deg = _middle(np.array([each.yaw_deg for each in steady]), sigmas_deg)
    pitch_deg, pitch_sigma_deg = _middle(np.array([each.pitch_deg for each in steady]), sigmas_deg)
    both = ((yaw_deg, yaw_sigma_deg), (pitch_deg, pitch_sigma_deg))
    if not any(abs(angle) > max(SMALLEST_DEG, params.drift_sigmas * sigma) for angle, sigma in both):
        return None
    return Drift(yaw_deg, pitch_deg, yaw_sigma_deg, pitch_sigma_deg, len(steady))


def _tells(item: FusedObject, box: Box, size: tuple[int, int]) -> bool:
    """Whether both sensors see all of the vehicle now."""
    if item.cuboid is None or not item.seen_by_two_sensors or item.label not in VEHICLES:
        return False
    is_whole = min(box[0], box[1], size[0] - box[2], size[1] - box[3]) > BORDER_PX
    return is_whole and item.distance_m is not None and NEAREST_M <= item.distance_m <= FARTHEST_M


def _angles(cuboid: Cuboid, box: Box, aligned: Alignment) -> tuple[float, float, float] | None:
    """Yaw and pitch between a cuboid and its box, and the box's height, degrees; None where their widths differ."""
    uv = aligned.project(cuboid.corners())
    if np.isnan(uv).any():
        return None
    left, right, foot = uv[:, 0].min(), uv[:, 0].max(), uv[:4, 1].max()
    if abs((right - left) - (box[2] - box[0])) > LIKE_WIDTH * (box[2] - box[0]):
        return None
    middle, middle_seen = (left + right) / 2, (box[0] + box[2]) / 2
    _, rays = aligned.rays(np.array([[middle, foot], [middle_seen, box[3]], [middle_seen, box[1]]]))
    azimuth = [atan2(y, x) for x, y, _ in rays]
    elevation = [atan2(z, hypot(x, y)) for x, y, z in rays]
    yaw, pitch, height = azimuth[0] - azimuth[1], elevation[1] - elevation[0], elevation[2] - elevation[1]
    return degrees(yaw), degrees(pitch), degrees(height)


def _with(before: Sighting | None, number: int, t_ns: int, found: tuple[float, float, float]) -> Sighting:
    """The sighting with one frame more."""
    if before is None:
        return Sighting(number, t_ns, 1, *found)
    frames = before.frames + 1
    yaw, pitch, height = (old + (new - old) / frames for old, new in zip(before[3:], found, strict=True))
    return Sighting(number, t_ns, frames, yaw, pitch, height)


def _sigma_deg(each: Sighting) -> float:
    """Standard deviation of a vehicle's mean."""
    return hypot(LASTING_DEG, LASTING_SHARE * each.height_deg, FRAME_SHARE * each.height_deg / each.frames**0.5)


def _middle(values: F64, sigmas: F64) -> tuple[float, float]:
    """Weighted median, which a wrong pair or two do not move, and its standard deviation: by the values' own deviations
    or by how far they lie apart, whichever is more."""
    order = np.argsort(values)
    weight = np.cumsum(sigmas[order] ** -2)
    middle = float(values[order][np.searchsorted(weight, weight[-1] / 2)])
    apart = 1.25 * float(np.mean(np.abs(values - middle))) / len(values) ** 0.5  # 1.25: of a normal distribution
    return middle, MEDIAN_LOSS * max(float(weight[-1]) ** -0.5, apart)
