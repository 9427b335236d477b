"""What the stages hand on: from detections and clusters to fused objects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.common.geometry import Cuboid
from pipeline.types.arrays import F64, Box, Mask, Point2, Point3, SourceKind


@dataclass(frozen=True)
class Ground:
    """The road under the sweep.

    mask: (N,) bool, kept points that are ground. planes: (S, 4) float64 ``nx ny nz d`` with n·p + d = 0, |n| = 1,
    n_z > 0; all NaN where no ground was found. edges: (S + 1,) float64, bounds of the segments along x in metres;
    the outer segments reach on beyond theirs. fitted: (S,) bool, false where the plane is a neighbour's.
    """

    mask: Mask
    planes: F64
    edges: F64
    fitted: Mask

    def height(self, xy: npt.NDArray[np.floating]) -> F64:
        """(M,) ground z in metres at (M, 2) ego places; NaN where no ground was found."""
        xy = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
        plane = self.planes[self._segment(xy[:, 0])]
        return np.asarray(-(plane[:, 3] + plane[:, 0] * xy[:, 0] + plane[:, 1] * xy[:, 1]) / plane[:, 2])

    def above(self, points: npt.NDArray[np.floating]) -> F64:
        """(M,) height in metres of (M, 3+) ego points over the ground, along its normal; NaN without ground."""
        plane = self.planes[self._segment(points[:, 0])]
        return np.asarray(np.sum(plane[:, :3] * points[:, :3], axis=1) + plane[:, 3])

    def _segment(self, x: npt.NDArray[np.floating]) -> npt.NDArray[np.intp]:
        return np.searchsorted(self.edges[1:-1], x, side="right")


@dataclass(frozen=True)
class Detection:
    """One box after thresholds and suppression."""

    bbox: Box
    label: str
    score: float


@dataclass(frozen=True)
class VisionMeasurement:
    """A detection with its estimated place. ``distance_m`` is the horizontal range from the ego origin to the nearest
    face; it and ``position`` (ego x, y of that face's centre) are null where no law gives a distance."""

    detection: Detection
    distance_m: float | None
    sigma_m: float | None
    position: Point2 | None


class Obstacle(NamedTuple):
    """One LiDAR cluster. ``density`` is points per square metre of footprint (paper: "number, density and
    distribution"); ``spread`` the standard deviation of its points along x, y, z in metres."""

    cluster: int
    cuboid: Cuboid
    closest_point: Point3
    points: int
    density: float
    spread: Point3


class LidarTrack(NamedTuple):
    """An obstacle followed over time. ``velocity_mps`` is relative to ego (x, y); null until two sightings.
    ``obstacle`` is the last one seen, moved by the prediction while ``carried``; ``unseen_s`` says for how long."""

    id: int
    obstacle: Obstacle
    velocity_mps: Point2 | None
    hits: int
    missed: int
    carried: bool
    unseen_s: float = 0.0


@dataclass(frozen=True)
class VisionTrack:
    """A detected box followed over time. ``distance_m``/``sigma_m``/``position``/``velocity_mps`` are filtered;
    null where never measured. A carried box was not seen in this frame; ``measured`` says whether its distance was (a
    box that the picture's edge cuts is seen, but not measured)."""

    id: int
    bbox: Box
    label: str
    score: float
    distance_m: float | None
    sigma_m: float | None
    position: Point2 | None
    velocity_mps: Point2 | None
    hits: int
    missed: int
    carried: bool
    measured: bool = True


class Gate(NamedTuple):
    """One test an object went through, with its number and limit; ``value`` is null when there was nothing to test."""

    name: str
    value: float | None
    limit: float
    passed: bool


@dataclass(frozen=True)
class FusedObject:
    """The paper's Table 3 row, widened by what the contract asks for. Frames and units as in the contract.

    A V object whose distance nobody knows (no law for its class, box cut by the picture's edge, beyond the law's
    reach) keeps its row: its place and distance are null, and it cannot be the CIPV.

    source: which sensors' tracks it is made of. seen_by: which of them saw it in this frame; none: it is carried.
    measured: its distance was measured in this frame; else it is a prediction.
    in_path_probability: what its sightings so far say together, the fresh ones most; in_path where it is over a half.
    lateral_mps: how fast it moves to the left of the path, over ground. crossing_s: until it is over the edge of it, or
    out of it where it is in; null when its sideways speed leads nowhere. lidar_hits: sightings of its LiDAR track.
    box_sides: ego x, y where the sight lines past its box's left and right edge are as far away as it is; null unless
    the camera sees it now."""

    id: int
    source: SourceKind
    label: str | None
    score: float | None
    bbox: Box | None
    bev: tuple[Point2, Point2, Point2, Point2] | None
    cuboid: Cuboid | None
    closest_point: Point3 | None
    distance_m: float | None
    distance_sigma_m: float | None
    velocity_mps: Point2 | None
    seen_by: Literal["", "V", "L", "VL"]
    hits: int
    lidar_points: int
    lidar_track: int | None
    vision_track: int | None
    gates: tuple[Gate, ...] = ()
    speed_over_ground_mps: float | None = None
    moving: bool | None = None
    ttc_s: float | None = None
    in_path: bool = False
    in_path_probability: float | None = None
    path_offset_m: float | None = None
    measured: bool = True
    lateral_mps: float | None = None
    crossing_s: float | None = None
    lidar_hits: int = 0
    box_sides: tuple[Point2, Point2] | None = None

    @property
    def carried(self) -> bool:
        """Not seen in this frame: where it is now is a prediction."""
        return not self.seen_by
