"""Objects followed over time: by the LiDAR, by the camera, and by both."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

from pipeline.common.geometry import Cuboid
from pipeline.types.arrays import Box, Point2, Point3
from pipeline.types.conditions import Braking, Eligibility, Gate
from pipeline.types.measurements import Obstacle
from pipeline.types.sensors import ObjectSource, are_several, is_camera_in, is_lidar_in, is_ranging_in, kinds_in

HeightFrom = Literal["class", "shape", "road", "range"] | None
"""How the height of a vehicle that the camera sees was estimated: from its class, from the shape of its boxes, from
where they meet the road, or from measured ranges. None without a distance."""


class LidarTrack(NamedTuple):
    """An obstacle followed over time."""

    id: int
    """Never reused."""
    obstacle: Obstacle
    """As last seen; while the track is carried, at its predicted position."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None until the second sighting."""
    hits: int
    """Sightings so far."""
    missed: int
    """Number of consecutive sweeps without it."""
    carried: bool
    """Not seen in this frame."""
    unseen_s: float = 0.0
    """Time since it was last seen."""
    rigid_mps: float | None = None
    """Speed along ego y, relative to ego, that both of its sides certainly share; None if it is not estimated."""
    steady: int = 1
    """Number of consecutive sightings near the predicted position, including the first sighting."""
    speed_sigma_mps: float | None = None
    """Standard deviation of each part of its velocity, by its filter; None until the second sighting."""


@dataclass(frozen=True)
class VisionTrack:
    """A detected box followed over time. Values that were never measured are None."""

    id: int
    """Never reused."""
    bbox: Box
    """Pixels of the raw image."""
    label: str
    """Class name in COCO's spelling."""
    score: float
    """The detector's score, 0–1."""
    distance_m: float | None
    """Horizontal range from the ego origin to the nearest face, filtered."""
    sigma_m: float | None
    """Standard deviation of the distance."""
    position: Point2 | None
    """Ego x, y of the nearest face's centre, filtered."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y, filtered."""
    hits: int
    """Sightings so far."""
    missed: int
    """Number of consecutive images without it."""
    carried: bool
    """Not seen in this frame."""
    measured: bool = True
    """Whether its distance was measured in this frame: a box cut by the image's edge is seen, but not measured."""
    ranges: int = 0
    """Number of consecutive distances that its position is based on, since that was last initialised."""
    returns: int = 0
    """Number of LiDAR returns inside its box that gave its distance in this frame; 0 without any."""
    height_from: HeightFrom = None
    """How its height was estimated, from which its distance is computed."""
    speed_sigma_mps: float | None = None
    """Standard deviation of its velocity along the line of sight, including the constant error of the distance law;
    None without a velocity."""
    wander_mps: float = 0.0
    """Standard deviation of the apparent speed of slowly wandering boxes: errors that last for a second look like
    motion."""
    images: int = 1
    """Number of images in which the detector ran, from its first sighting on."""

    @property
    def boxed_share(self) -> float:
        """Share of ``images`` in which it was detected."""
        return self.hits / self.images


class RangedTrack(NamedTuple):
    """An object that a ranging sensor other than the LiDAR, such as a radar, follows over time."""

    id: int
    """Never reused by its sensor."""
    position: Point2
    """Ego x, y of its nearest point, filtered."""
    sigma_m: Point2
    """Standard deviation of the position along the line of sight and across it."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None while unknown."""
    hits: int
    """Sightings so far."""
    carried: bool
    """Not seen in this frame."""
    steady: int = 1
    """Number of consecutive sightings near the predicted position, including the first sighting."""


DistanceFrom = str | None
"""What the distance was measured from in this frame: ``cluster``, a LiDAR cluster; ``returns``, single LiDAR returns
inside the image box; ``box``, the height of that box; or the name of another ranging sensor. None: not measured."""


@dataclass(frozen=True)
class FusedObject:
    """One physical object: a row of the paper's Table 3, extended as in docs/reference/results.md, which defines frames
    and units.

    A V object of unknown distance (no law for its class, a box cut by the image's edge, beyond the range of the law)
    keeps its row; its position and distance are None, and it cannot be the CIPV.

    Stages use capabilities (``ranged``, ``seen_by_lidar``); the letters in ``source`` and ``seen_by`` are only for the
    result.
    """

    id: int
    """Stays the same from frame to frame, whichever sensors see the object."""
    source: ObjectSource
    """The sensors whose tracks it consists of."""
    label: str | None
    """Its class according to the camera; None if only the LiDAR sees it."""
    score: float | None
    """The detector's score for that class, 0–1."""
    bbox: Box | None
    """Its image box, pixels; None outside the image."""
    bev: tuple[Point2, Point2, Point2, Point2] | None
    """Footprint: ego x, y of front left, front right, rear right, rear left."""
    cuboid: Cuboid | None
    """Box around its LiDAR points; None without points."""
    closest_point: Point3 | None
    """Ego x, y, z of its point nearest to the ego origin."""
    distance_m: float | None
    """Horizontal range from the ego origin to that point."""
    distance_sigma_m: float | None
    """Standard deviation of the distance."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None while unknown."""
    seen_by: ObjectSource
    """The sensors that saw it in this frame; empty if it is carried."""
    hits: int
    """Sightings so far, by the sensor with most of them."""
    lidar_points: int
    """Number of points of its last cluster."""
    lidar_track: int | None
    """Id of its LiDAR track."""
    vision_track: int | None
    """Id of its vision track."""
    gates: tuple[Gate, ...] = ()
    """The tests of this object, for display."""
    speed_over_ground_mps: float | None = None
    """None while own speed is unknown."""
    speed_over_ground_sigma_mps: float | None = None
    """Its standard deviation; None where it is not known, as for what the camera alone sees in less than half of the
    images."""
    oncoming: bool | None = None
    """Whether it drives in the opposite direction, within 45°; None while own speed is unknown."""
    moving: bool | None = None
    """Whether it moves over ground; None while own speed is unknown."""
    surely_moving: bool | None = None
    """Whether it moves faster than the error of its speed can explain; None while own speed is unknown."""
    ttc_s: float | None = None
    """Time to collision; None while the gap does not shrink."""
    in_path: bool = False
    """Whether ``in_path_probability`` is above a half."""
    in_path_probability: float | None = None
    """From all its sightings so far, with the most weight on recent ones; None while its position is unknown."""
    path_offset_m: float | None = None
    """From the path's centre to the middle of its nearest face, positive to the left."""
    path_margin_m: float | None = None
    """How far inside the path it is by this sighting alone, negative outside; None while its position is unknown."""
    measured: bool = True
    """Whether its distance was measured in this frame; otherwise it is predicted."""
    lateral_mps: float | None = None
    """Speed to the left of the path, over ground."""
    crossing_s: float | None = None
    """Time until it enters the path or, if it is inside, leaves it; None if its lateral speed leads to neither."""
    clears_path_s: float | None = None
    """For an object that crosses the path: how long before the car arrives it will have left it. None for others, and
    if the car might meet it."""
    ranged_hits: int = 0
    """Sightings by a ranging sensor, by the one with most of them; 0 without one."""
    ranged_steady: int = 0
    """The most recent consecutive ones of these that were near the predicted position."""
    justifies: Braking = Braking.FULL
    """The hardest braking that the evidence for it justifies."""
    camera_ranges: int = 0
    """Number of consecutive distances that its vision track is based on."""
    camera_speed_sigma_mps: float | None = None
    """Standard deviation of its velocity along the line of sight, if that comes from its image boxes."""
    camera_wander_mps: float = 0.0
    """As ``VisionTrack.wander_mps``: decides whether it may be standing."""
    lidar_speed_sigma_mps: float | None = None
    """Standard deviation of its velocity, if that comes from the LiDAR."""
    boxed_share: float = 1.0
    """As ``VisionTrack.boxed_share``; 1 without a vision track."""
    returns: int = 0
    """Number of LiDAR returns inside its image box that gave its distance in this frame; 0 with a cluster."""
    height_from: HeightFrom = None
    """How the camera estimated its height, from which its distance is computed; None with a cluster."""
    existence: float | None = None
    """Probability that it exists, from the evidence of all sensors; None if that is switched off."""
    rigid_mps: float | None = None
    """As ``LidarTrack.rigid_mps``; None without a LiDAR track."""
    box_sides: tuple[Point2, Point2] | None = None
    """Ego x, y of its box's left and right edge at its distance; None unless the camera sees it in this frame."""
    eligibility: Eligibility | None = None
    """Which conditions of a lead it meets; None until it has been checked."""

    @property
    def distance_from(self) -> DistanceFrom:
        """What its distance was measured from in this frame."""
        if self.carried or not self.measured or self.distance_m is None:
            return None
        if self.seen_by_lidar:
            return "cluster"
        if self.ranged_now:
            return next(kind.name for kind in kinds_in(self.seen_by) if kind.is_ranging)
        return "returns" if self.returns else "box"

    @property
    def carried(self) -> bool:
        """Not seen in this frame: its position is predicted."""
        return not self.seen_by

    @property
    def ranged(self) -> bool:
        """A ranging sensor follows it. Otherwise its distance and speed come from the height of its image box, and are
        much less accurate."""
        return is_ranging_in(self.source)

    @property
    def ranged_now(self) -> bool:
        """A ranging sensor saw it in this frame."""
        return is_ranging_in(self.seen_by)

    @property
    def imaged(self) -> bool:
        """The camera follows it, so that its class is known."""
        return is_camera_in(self.source)

    @property
    def tracked_by_two_sensors(self) -> bool:
        """More than one sensor follows it, whether or not each saw it in this frame."""
        return are_several(self.source)

    @property
    def seen_by_camera(self) -> bool:
        """The camera saw it in this frame."""
        return is_camera_in(self.seen_by)

    @property
    def seen_by_lidar(self) -> bool:
        """The LiDAR saw it in this frame."""
        return is_lidar_in(self.seen_by)

    @property
    def seen_by_two_sensors(self) -> bool:
        """More than one sensor saw it in this frame, which confirms it at once."""
        return are_several(self.seen_by)
