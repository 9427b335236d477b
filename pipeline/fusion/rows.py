"""Builds the row of an object from the tracks that it consists of (paper, Table 3)."""

from __future__ import annotations

import math

from pipeline.common.fast_replace import evolve
from pipeline.fusion.vehicle_sizes import usual_size_m
from pipeline.types import Box, FusedObject, Gate, LidarTrack, Point2, VisionTrack
from pipeline.types.sensors import CAMERA, LIDAR

LIDAR_RANGE_SIGMA_M = 0.2
"""Standard deviation of a cluster's nearest point as an estimate of the vehicle's nearest point: the VLP-16's ±3 cm,
plus where its beams hit the bumper and grille. Compared with the nearest corner of 400 labelled vehicles: 90 % within
0.3 to 0.5 m."""

CARRIED_SPEED_SIGMA_MPS, CARRIED_ACCEL_SIGMA_MPS2 = 0.5, 3.0

V, L = CAMERA.letter, LIDAR.letter
Quad = tuple[Point2, Point2, Point2, Point2]
Sides = tuple[Point2, Point2]

UNKNOWN = FusedObject(
    id=0,
    source=V,
    label=None,
    score=None,
    bbox=None,
    bev=None,
    cuboid=None,
    closest_point=None,
    distance_m=None,
    distance_sigma_m=None,
    velocity_mps=None,
    seen_by="",
    hits=0,
    lidar_points=0,
    lidar_track=None,
    vision_track=None,
)
"""A row with all fields unknown. Every row is derived from it, because ``evolve`` takes a quarter of the time of a
frozen record's ``__init__``."""


def hit_row(
    object_id: int,
    seen: VisionTrack | None,
    hit: LidarTrack,
    box: Box | None,
    footprint: Quad,
    range_m: float,
    sigma_m: float,
    gates: tuple[Gate, ...],
    sides: Sides | None = None,
) -> FusedObject:
    """Table 3 for an object seen by the LiDAR: position, distance and velocity are from the LiDAR, the class is from
    the camera. sides: as ``FusedObject.box_sides``."""
    seen_by_lidar = "" if hit.carried else L
    by_camera = (
        {"source": L, "bbox": box, "velocity_mps": hit.velocity_mps, "seen_by": seen_by_lidar, "hits": hit.hits}
        if seen is None
        else {
            "source": V + L,
            "label": seen.label,
            "score": seen.score,
            "bbox": box if box is not None else seen.bbox,
            # in the one frame in which the LiDAR finds an object that the camera already follows, the velocity is the
            # camera's, so that braking for it does not lose its speed
            "velocity_mps": hit.velocity_mps if hit.velocity_mps is not None else seen.velocity_mps,
            "seen_by": seen_by_lidar if seen.carried else V + seen_by_lidar,
            "hits": max(hit.hits, seen.hits),
            "vision_track": seen.id,
            "camera_ranges": seen.ranges,
            "boxed_share": seen.boxed_share,
            "box_sides": sides,
        }
    )
    return evolve(
        UNKNOWN,
        id=object_id,
        bev=footprint,
        cuboid=hit.obstacle.cuboid,
        closest_point=hit.obstacle.closest_point,
        distance_m=range_m,
        distance_sigma_m=sigma_m,
        measured=not hit.carried,
        lidar_points=hit.obstacle.points,
        lidar_track=hit.id,
        ranged_hits=hit.hits,
        ranged_steady=hit.steady,
        rigid_mps=hit.rigid_mps,
        lidar_speed_sigma_mps=hit.speed_sigma_mps,
        gates=gates,
        **by_camera,
    )


def box_row(object_id: int, seen: VisionTrack, gates: tuple[Gate, ...], sides: Sides | None = None) -> FusedObject:
    """Table 3 for an object seen only by the camera. sides: as ``FusedObject.box_sides``."""
    place = seen.position
    return evolve(
        UNKNOWN,
        id=object_id,
        label=seen.label,
        score=seen.score,
        bbox=seen.bbox,
        bev=typical_footprint(place, seen.label) if place is not None else None,
        closest_point=(*place, 0.0) if place is not None else None,
        distance_m=seen.distance_m,
        distance_sigma_m=seen.sigma_m,
        velocity_mps=seen.velocity_mps,
        seen_by="" if seen.carried else V,
        measured=seen.measured,
        hits=seen.hits,
        vision_track=seen.id,
        camera_ranges=seen.ranges,
        boxed_share=seen.boxed_share,
        camera_speed_sigma_mps=seen.speed_sigma_mps,
        camera_wander_mps=seen.wander_mps,
        returns=seen.returns,
        height_from=seen.height_from,
        gates=gates,
        box_sides=sides,
    )


def range_m(track: LidarTrack) -> float:
    """Horizontal range from the ego origin to the cluster's nearest point."""
    x, y, _ = track.obstacle.closest_point
    return math.hypot(x, y)


def typical_footprint(near_face: Point2, label: str) -> Quad:
    """A rectangle of a class's usual size behind a measured nearest face. Its orientation is unknown: vehicles ahead
    are drawn along ego x."""
    length, width, _ = usual_size_m(label)
    x, y = near_face
    return (x + length, y + width / 2), (x + length, y - width / 2), (x, y - width / 2), (x, y + width / 2)


def lidar_sigma_m(track: LidarTrack) -> float:
    """Standard deviation of a LiDAR track's distance. It grows while the track is carried, due to the error of the
    tracked speed and possible manoeuvres of the object."""
    drift_m = CARRIED_SPEED_SIGMA_MPS * track.unseen_s + CARRIED_ACCEL_SIGMA_MPS2 * track.unseen_s**2 / 2
    return math.hypot(LIDAR_RANGE_SIGMA_M, drift_m)


def quad(corners: list[list[float]]) -> Quad:
    """Four corners as tuples."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = corners
    return (ax, ay), (bx, by), (cx, cy), (dx, dy)
