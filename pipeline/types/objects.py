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
"""Of a vehicle that the camera sees: the usual height of its class; the shape of its boxes; where they meet the road;
measured ranges; None without a distance."""


class LidarTrack(NamedTuple):
    """An obstacle followed over time."""

    id: int
    """Never given twice."""
    obstacle: Obstacle
    """The last one seen, moved by the prediction while the track is carried."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None until two sightings."""
    hits: int
    """Sightings so far."""
    missed: int
    """Sweeps in a row that lacked it."""
    carried: bool
    """Not seen in this frame."""
    unseen_s: float = 0.0
    """Time since it was last seen."""
    rigid_mps: float | None = None
    """How fast both sides of it surely move together along ego y, relative to ego; None where that is not asked."""
    steady: int = 1
    """Sightings in a row, with the first one, that lay where the track was expected."""


@dataclass(frozen=True)
class VisionTrack:
    """A detected box followed over time. What was never measured is None."""

    id: int
    """Never given twice."""
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
    """Images in a row that lacked it."""
    carried: bool
    """Not seen in this frame."""
    measured: bool = True
    """Whether its distance was measured in this frame: a box cut by the image's edge is seen, but not measured."""
    ranges: int = 0
    """Distances in a row that its place took in, since it was last begun."""
    returns: int = 0
    """LiDAR returns inside its box that its distance was measured by in this frame."""
    height_from: HeightFrom = None
    """How tall it is taken for, on which its distance rests."""
    speed_sigma_mps: float | None = None
    """Standard deviation of its velocity along the line of sight, with that of the law's lasting error; None without a
    velocity."""
    wander_mps: float = 0.0
    """The same because boxes wander: errors that last for a second or more seem to be motion."""
    images: int = 1
    """Images since its first sighting, with that one, in which the detector ran."""

    @property
    def boxed_share(self) -> float:
        """Share of these images that have its box."""
        return self.hits / self.images


class RangedTrack(NamedTuple):
    """What a ranging sensor other than the LiDAR, such as a radar, has followed over time."""

    id: int
    """Never given twice by its sensor."""
    position: Point2
    """Ego x, y of its nearest point, filtered."""
    sigma_m: Point2
    """Standard deviation of the position along the line of sight and across it."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None until it is known."""
    hits: int
    """Sightings so far."""
    carried: bool
    """Not seen in this frame."""
    steady: int = 1
    """Sightings in a row, with the first one, that lay where the track was expected."""


DistanceFrom = str | None
"""``cluster``: a LiDAR cluster; ``returns``: single LiDAR returns inside its image box; ``box``: the height of that
box; the name of another ranging sensor; None: nothing in this frame."""


@dataclass(frozen=True)
class FusedObject:
    """One physical object: the paper's Table 3 row, with what docs/reference/results.md adds; its frames and units
    apply.

    A V object whose distance is not known (no law for its class, a box cut by the image's edge, beyond the law's
    reach) keeps its row; its place and distance are None, and it cannot be the CIPV.

    Stages ask for capabilities (``ranged``, ``seen_by_lidar``); the letters of ``source`` and ``seen_by`` are for the
    result.
    """

    id: int
    """Id of the object, stable from frame to frame, whichever sensors see the object."""
    source: ObjectSource
    """Which sensors' tracks it is made of."""
    label: str | None
    """Its class, by the camera; None for what only the LiDAR has."""
    score: float | None
    """The detector's score for that class, 0–1."""
    bbox: Box | None
    """Its image box, pixels; None outside the image."""
    bev: tuple[Point2, Point2, Point2, Point2] | None
    """Its footprint from above: ego x, y of front left, front right, rear right, rear left."""
    cuboid: Cuboid | None
    """The box around its LiDAR points; None without any."""
    closest_point: Point3 | None
    """Ego x, y, z of the point of it that is nearest to the ego origin."""
    distance_m: float | None
    """Horizontal range from the ego origin to that point."""
    distance_sigma_m: float | None
    """Standard deviation of the distance."""
    velocity_mps: Point2 | None
    """Relative to ego, x and y; None until it can be told."""
    seen_by: ObjectSource
    """Which of its sensors saw it in this frame; none: it is carried."""
    hits: int
    """Sightings so far, by the sensor that has more of them."""
    lidar_points: int
    """Points of its last cluster."""
    lidar_track: int | None
    """Id of its LiDAR track."""
    vision_track: int | None
    """Id of its vision track."""
    gates: tuple[Gate, ...] = ()
    """The tests it went through, for display."""
    speed_over_ground_mps: float | None = None
    """None where own speed is not known."""
    oncoming: bool | None = None
    """Whether it drives against our direction, within 45°; None where own speed is not known."""
    moving: bool | None = None
    """Whether it moves over the ground; None where own speed is not known."""
    surely_moving: bool | None = None
    """Whether it moves by more than the error of its speed explains; None where own speed is not known."""
    ttc_s: float | None = None
    """Time to collision; None while the gap does not shrink."""
    in_path: bool = False
    """Whether ``in_path_probability`` is above a half."""
    in_path_probability: float | None = None
    """What its sightings so far say together, the fresh ones most; None where its place is not known."""
    path_offset_m: float | None = None
    """From the path's centre to the middle of its nearest face, positive to the left."""
    path_margin_m: float | None = None
    """How far inside the path this sighting alone places it, negative outside; None where its place is not known."""
    measured: bool = True
    """Whether its distance was measured in this frame; otherwise it is a prediction."""
    lateral_mps: float | None = None
    """Speed to the left of the path, over ground."""
    crossing_s: float | None = None
    """Until it is over the edge of the path, or out of the path if it is in it; None when its sideways speed leads to
    neither."""
    clears_path_s: float | None = None
    """How long before the car arrives it will have left the path that it crosses; None for one that does not cross, or
    that the car might meet."""
    ranged_hits: int = 0
    """Sightings by the sensor that measures range, by the one that has more of them; 0 without one."""
    ranged_steady: int = 0
    """The most recent of these in a row that were where the track was expected."""
    justifies: Braking = Braking.FULL
    """The hardest braking that what is known of it can justify."""
    camera_ranges: int = 0
    """Distances in a row that its vision track took in."""
    camera_speed_sigma_mps: float | None = None
    """Standard deviation of its velocity along the line of sight where that comes from its image boxes."""
    camera_wander_mps: float = 0.0
    """The same because its boxes wander, which matters for whether it moves at all."""
    boxed_share: float = 1.0
    """Share of the images since its first box that have one; 1 without a vision track."""
    returns: int = 0
    """LiDAR returns inside its image box that ranged it in this frame, where it has no cluster."""
    height_from: HeightFrom = None
    """What the camera alone takes its height from, on which its distance rests; None for an object with a cluster."""
    existence: float | None = None
    """Probability that it is really there, by the evidence of both sensors; None where that is not weighed."""
    rigid_mps: float | None = None
    """Of its LiDAR track: how fast both its sides surely move together along ego y, relative to ego. None without."""
    box_sides: tuple[Point2, Point2] | None = None
    """Ego x, y where the lines of sight past its box's left and right edge are as far away as the object; None unless
    the camera sees it now."""
    eligibility: Eligibility | None = None
    """Which conditions of a lead it meets; None before it was judged."""

    @property
    def distance_from(self) -> DistanceFrom:
        """What its distance was measured by in this frame."""
        if self.carried or not self.measured or self.distance_m is None:
            return None
        if self.seen_by_lidar:
            return "cluster"
        if self.ranged_now:
            return next(kind.name for kind in kinds_in(self.seen_by) if kind.is_ranging)
        return "returns" if self.returns else "box"

    @property
    def carried(self) -> bool:
        """Not seen in this frame: where it is now is a prediction."""
        return not self.seen_by

    @property
    def ranged(self) -> bool:
        """A sensor that measures range follows it. Otherwise its distance and speed come from the height of its image
        box, and are much less sure."""
        return is_ranging_in(self.source)

    @property
    def ranged_now(self) -> bool:
        """A sensor that measures range saw it in this frame."""
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
        """More than one sensor saw it in this frame, so no second look is needed to believe in it."""
        return are_several(self.seen_by)
