"""What one frame shows: the road, the detector's boxes and their distances, the LiDAR's clusters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.common.geometry import Cuboid
from pipeline.types.arrays import F64, Box, Mask, Point2, Point3
from pipeline.types.ground_planes import grounds_z, heights_above


@dataclass(frozen=True)
class Ground:
    """The road under the sweep, as one plane for each segment along x."""

    mask: Mask
    """(N,) bool, kept points that are ground."""
    planes: F64
    """(S, 4) float64 ``nx ny nz d`` with n·p + d = 0, |n| = 1, n_z > 0; all NaN where no ground was found."""
    edges: F64
    """(S + 1,) float64, bounds of the segments along x in metres; the outer segments extend beyond theirs."""
    fitted: Mask
    """(S,) bool, false where the plane is a neighbour's or the previous sweep's."""

    def height(self, xy: npt.NDArray[np.floating]) -> F64:
        """(M,) ground z in metres at (M, 2) ego places; NaN where no ground was found."""
        places = np.ascontiguousarray(xy, dtype=np.float64).reshape(-1, 2)
        return np.asarray(grounds_z(self.planes, self.edges, places))

    def above(self, points: npt.NDArray[np.floating]) -> F64:
        """(M,) height in metres of (M, 3+) ego points over the ground, along its normal; NaN without ground."""
        dtype = np.float32 if points.dtype == np.float32 else np.float64
        return np.asarray(heights_above(self.planes, self.edges, np.ascontiguousarray(points, dtype=dtype)))


@dataclass(frozen=True)
class Detection:
    """One box after thresholds and suppression."""

    bbox: Box
    """Pixels of the raw image."""
    label: str
    """Class name in COCO's spelling."""
    score: float
    """0–1."""


class RoadSight(NamedTuple):
    """How a box's lower edge fits the road if the vehicle is G times as tall as its class
    (``pipeline.vision.vehicle_height.HEIGHT_RATIOS``) and therefore as much farther away."""

    above: F64
    """(G,) height at which the line of sight of the edge passes over the road there, divided by the distance."""
    lasting: F64
    """(G,) its standard deviation for what lasts from image to image: the shape of the road, and the alignment."""
    noise: float
    """Its standard deviation for what changes: the noise of the edge."""
    tall: float
    """Slope that the box spans from its lower edge to its upper one."""


@dataclass(frozen=True)
class VisionMeasurement:
    """A detection with its estimated place."""

    detection: Detection
    """The box."""
    distance_m: float | None
    """Horizontal range from the ego origin to the nearest face; None where no law gives a distance."""
    sigma_m: float | None
    """Standard deviation of the distance."""
    position: Point2 | None
    """Ego x, y of the nearest face's centre."""
    noise_share: float | None = None
    """Share of the distance by which it differs from image to image: the noise of the box's height. The rest of
    ``sigma_m`` is the object's own unknown height, which no number of images averages out."""
    size_share: float | None = None
    """The share of the distance by which vehicles of the class differ in height."""
    ranged_m: float | None = None
    """The same distance by LiDAR returns inside the box; None without any."""
    ranged_sigma_m: float = 0.0
    """Standard deviation of ``ranged_m``."""
    returns: int = 0
    """How many returns that is."""
    road: RoadSight | None = None
    """Where its lower edge is relative to the road; None where that is not seen."""
    aspect: float | None = None
    """ln(height / width) of the box; None where it may show only part of the object's width."""
    class_factors: Mapping[str, float] = field(default_factory=dict)
    """By class name: how many times as far away the same box would be, were it of that class and not a car's."""

    def distance_as(self, label: str) -> float | None:
        """The distance if the object is of this class, whatever the detector called it this time."""
        said, meant = self.class_factors.get(self.detection.label), self.class_factors.get(label)
        if self.distance_m is None or said is None or meant is None:
            return self.distance_m
        return self.distance_m * meant / said


class Obstacle(NamedTuple):
    """One LiDAR cluster, described by what the paper tracks it by: "number, density and distribution" of its points."""

    cluster: int
    """Its number in this sweep."""
    cuboid: Cuboid
    """The box around its points, standing on the ground."""
    closest_point: Point3
    """Its point of least horizontal range from the ego origin."""
    points: int
    """How many points it has."""
    density: float
    """Points per square metre of footprint."""
    spread: Point3
    """Standard deviation of its points along x, y and z, metres."""
