"""The output of the networks for an image, before any geometry, and the law that gives the distance of a box."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.types.arrays import F32, I32, Mask, PixelWindow


@dataclass(frozen=True)
class DistanceLaw:
    """Distance from the height of a detector's boxes: depth of a car in metres = coefficient · height ^ exponent.

    The numbers depend on how tightly a network draws its boxes and how tall the vehicles are, so each detector has its
    own law.
    """

    coefficient: float
    """Depth in metres at a height of one pixel."""
    exponent: float
    """−1 for an ideal pinhole camera."""
    focal_px: float
    """Focal length of the camera that the heights refer to."""
    truck_ratio: float
    """Height of a truck's box relative to a car's at the same depth."""
    bus_ratio: float
    """The same ratio for a bus."""
    motorcycle_ratio: float
    """The same ratio for a motorcycle."""

    def at_focal(self, focal_px: float) -> DistanceLaw:
        """The same law for heights in images of a camera with another focal length."""
        factor = (self.focal_px / focal_px) ** self.exponent
        return replace(self, coefficient=self.coefficient * factor, focal_px=focal_px)


REAL_VEHICLES = DistanceLaw(1444.0, -1.0, 907.0, truck_ratio=1.6, bus_ratio=2.0, motorcycle_ratio=0.75)
"""The default for a detector without its own law. Fitted by ``pipeline.calibration.distance`` to YOLOX's boxes of 38
labelled cars, 1.59 m tall, from two real cameras (Astyx 047–051 and 057–059, KITTI 2011_09_26 drive 0052). 907 px is
720p with a 78° diagonal. Motorcycles are boxed without their riders."""


@dataclass(frozen=True)
class RawBoxes:
    """A detector's candidates above a low floor, before thresholds and non-maximum suppression.

    This is what is cached per image and model: thresholds are pipeline parameters and can change, the network cannot.
    """

    model: str
    """The detector's name; equal names give equal boxes."""
    boxes: F32
    """(M, 4) float32 ``x1 y1 x2 y2``, pixels of the raw image."""
    scores: F32
    """(M,) float32, 0–1."""
    labels: tuple[str, ...]
    """M class names in COCO's spelling."""
    law: DistanceLaw = REAL_VEHICLES
    """Law for distance from box height, unless a parameter overrides it."""
    far: PixelWindow | None = None
    """The image region that was detected a second time at native resolution; None without a second pass."""
    far_count: int = 0
    """How many candidates come from the second pass; they are the last ones."""

    def with_far(self, far: RawBoxes, kept: Mask) -> RawBoxes:
        """These candidates, then those of the second pass for which ``kept`` (M,) holds. Duplicates are removed later,
        by non-maximum suppression."""
        labels = tuple(label for label, is_kept in zip(far.labels, kept.tolist(), strict=True) if is_kept)
        return replace(
            self,
            boxes=np.concatenate([self.boxes, far.boxes[kept]]),
            scores=np.concatenate([self.scores, far.scores[kept]]),
            labels=self.labels + labels,
            far=far.far,
            far_count=len(labels),
        )

    def without_far(self) -> RawBoxes:
        """Only the candidates of the pass over the whole image."""
        count = len(self.boxes) - self.far_count
        return replace(
            self,
            boxes=self.boxes[:count],
            scores=self.scores[:count],
            labels=self.labels[:count],
            far=None,
            far_count=0,
        )


ROAD_LEFT, ROAD_RIGHT = -3, -2
"""``RawLanes.line`` of points on the left and right edge of the drivable area."""


@dataclass(frozen=True)
class RawLanes:
    """What a lane detector saw in one image, before any geometry; cached per image and model like ``RawBoxes``."""

    model: str
    """The detector's name; equal names give equal points."""
    points: F32
    """(M, 2) float32 ``u v`` on painted lines and the edges of the drivable area, pixels of the raw image."""
    scores: F32
    """(M,) float32, 0–1."""
    line: I32
    """(M,) int32, which line each point belongs to; −1 where the detector does not group its points, ``ROAD_LEFT`` and
    ``ROAD_RIGHT`` on the edges of the drivable area."""
    age_s: float = 0.0
    """How much older their image is than the frame, in seconds; 0 for the frame's own image. With live sensors, a
    network that is slower than they are must not delay a frame."""
    window: PixelWindow | None = None
    """The only part of the image that was processed; None for the whole image."""

    def painted(self) -> RawLanes:
        """Only the points on painted lines."""
        return self.only(self.line >= -1)

    def road_edges(self) -> RawLanes:
        """Only the points on the edges of the drivable area."""
        return self.only(self.line < -1)

    def only(self, kept: Mask) -> RawLanes:
        """The points of a mask (M,)."""
        if kept.all():
            return self
        return replace(self, points=self.points[kept], scores=self.scores[kept], line=self.line[kept])
