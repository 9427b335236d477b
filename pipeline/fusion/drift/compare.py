"""Compares LiDAR tracks with the detector's boxes in one frame: by which angle the camera would have to be turned so
that each box covers its cluster.

Boxes and clusters are paired here, not taken from fusion: once the camera has turned by two degrees, fusion no longer
joins a distant vehicle with its box, which is when they matter most. Every box and cluster within ``REACH_DEG`` of each
other with a similar size may be a pair. A wrong pair suggests any angle, right pairs all suggest the same one; so the
angle that most vehicles of the frame agree on decides who belongs together. No distance law is involved.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.geometry import corners_of
from pipeline.fusion.boxes_in_front import nearer
from pipeline.lidar.road_profile import ASIDE_M, RoadProfile
from pipeline.types import F64, VEHICLES, LidarTrack, Mask, VisionMeasurement

REACH_DEG = 4.0
"""Largest angle between a box and its cluster."""
MIN_SCORE = 0.4
"""Boxes with lower scores are often of other objects."""
BORDER_PX = 3.0
"""A box this close to the image's border counts as cut."""
SAME_WIDTH, NARROWEST = 0.1, 0.4
"""If the widths of cluster and box differ by a smaller share than the first, both sensors see the same two edges. From
the second share on, the cluster lacks the vehicle's side, and only its outer edge counts."""
WIDEST = 1.2
"""Clusters that are wider than this share of the box contain something else too. Of 47 such pairs in simulated drives
none was right, of those narrower than 1.1 three quarters; on KITTI 0052, where boxes are tight, the lead's is 1.05 to
1.15 of its box."""
FACING_DEG = 3.0
"""A cluster turned by less against the line of sight may show either side: its orientation is known to about 2°, and
the side of a car of 4.5 m would be 0.2 m wide."""
HALF_BEAM_DEG = 0.1
"""A cluster ends on average half a step between two beams inside the vehicle's edge."""
HIDDEN_SHARE = 0.1
"""A box that ends nearer than this share of its width to a nearer box may be hidden there: edges of boxes vary by as
much."""
NARROWEST_M = 1.3
"""Narrower clusters are the visible part of a vehicle behind others; a detector draws the box of the whole vehicle."""
LOWEST_M, HIGHEST_M = 1.0, 4.5
"""Heights of vehicles, to which a box at the range of its cluster must correspond."""
NEAREST_M, FARTHEST_M = 7.0, 45.0
"""Closer, the two mounts see different sides of a car; farther, only one or two rings hit it."""
BESIDE_M = 2.0
"""The profile of the road is used for vehicles this far beside the strip that it was fitted to."""
FEWEST_HITS = 3
"""Sightings of a LiDAR track before it counts."""
FASTEST_DEGPS = 6.0
"""Faster bearings belong to vehicles that we pass, which are seen from a different side in every frame."""
AGREE_DEG, KEPT = 0.6, 0.5
"""Distance at which two pairs still support the same angle; head start of the angle that held so far, in vehicles."""


class Offset(NamedTuple):
    """Angle between a LiDAR track and its box."""

    track: int
    """Id of the LiDAR track."""
    yaw_deg: float
    """Camera rotation to the left that would align the two."""
    pitch_deg: float
    """The same for rotation downwards."""
    rate_degps: float
    """Rate of change of its bearing, positive to the left."""
    height_deg: float
    """Height of the box."""
    road_deg: float
    """Standard deviation of the pitch for not knowing the road's height under the vehicle; 0 where the cluster's own
    foot is compared."""
    sizes_m: tuple[float, float, float]
    """Height and width of the box and width of the cluster, at the range of the cluster. A turned camera changes none
    of them; another box or cluster does."""


def offsets(
    tracks: Sequence[LidarTrack],
    boxes: Sequence[VisionMeasurement],
    aligned: Alignment,
    size: tuple[int, int],
    held: tuple[float, float],
    road: RoadProfile | None = None,
) -> list[Offset]:
    """Of all vehicles that both sensors see in this frame. held: yaw and pitch (degrees) that have held so far. road:
    on which the vehicles stand."""
    usable = [each for each in tracks if _may_tell(each)]
    edges = _box_edges(boxes, aligned, size)
    if not usable or not len(edges):
        return []
    start, _ = aligned.rays(np.zeros((1, 2)))
    spans = _cluster_spans(usable, start, road)
    track, box = _candidates(spans, edges)
    if not len(track):
        return []
    yaw, is_told = _yaws(spans[track], edges[box])
    pitch = edges[box, 2] - spans[track, 2]
    near = is_told & (np.abs(yaw) < REACH_DEG) & (np.abs(pitch) < REACH_DEG)
    track, box, votes = track[near], box[near], np.column_stack([yaw[near], pitch[near]])
    chosen = _agreeing(track, box, votes, held)
    span, edge = spans[track[chosen]], edges[box[chosen]]
    heights = edge[:, 3] - edge[:, 2]
    sizes = np.radians(np.column_stack([heights, edge[:, 0] - edge[:, 1], span[:, 0] - span[:, 1]])) * span[:, 5:6]
    columns = (votes[chosen], span[:, 4], heights, span[:, 6], sizes)
    rows = zip(track[chosen].tolist(), *(column.tolist() for column in columns), strict=True)
    return [
        Offset(usable[number].id, yaw, pitch, rate, height, road_deg, (high, wide, cluster))
        for number, (yaw, pitch), rate, height, road_deg, (high, wide, cluster) in rows
    ]


def _may_tell(track: LidarTrack) -> bool:
    cuboid = track.obstacle.cuboid
    x, y, _ = cuboid.center
    return (
        not track.carried
        and track.hits >= FEWEST_HITS
        and x > 0.0
        and cuboid.size[1] >= NARROWEST_M
        and NEAREST_M <= float(np.hypot(x, y)) <= FARTHEST_M
    )


def _box_edges(boxes: Sequence[VisionMeasurement], aligned: Alignment, size: tuple[int, int]) -> F64:
    """(B, 6) of the vehicles' boxes that the border does not cut: left and right azimuth, lower and upper elevation,
    degrees; whether something nearer may hide the left and the right edge."""
    vehicles = [each.detection for each in boxes if each.detection.label in VEHICLES]
    box = np.array([each.bbox for each in vehicles]).reshape(-1, 4)
    whole = (box[:, :2].min(axis=1, initial=np.inf) > BORDER_PX) & (box[:, 2] < size[0] - BORDER_PX)
    whole &= (box[:, 3] < size[1] - BORDER_PX) & (np.array([each.score for each in vehicles]) >= MIN_SCORE)
    if not whole.any():
        return np.zeros((0, 6))
    hidden, box = _hidden_edges(box)[whole], box[whole]
    u, v = box[:, :3:2].mean(axis=1), box[:, 1::2].mean(axis=1)
    pixels = np.stack([box[:, 0], v, box[:, 2], v, u, box[:, 3], u, box[:, 1]], axis=1).reshape(-1, 2)
    _, rays = aligned.rays(pixels)
    azimuth = np.degrees(np.arctan2(rays[:, 1], rays[:, 0])).reshape(-1, 4)
    elevation = np.degrees(np.arctan2(rays[:, 2], np.hypot(rays[:, 0], rays[:, 1]))).reshape(-1, 4)
    return np.column_stack([azimuth[:, :2], elevation[:, 2:], hidden])


def _hidden_edges(box: F64) -> Mask:
    """(B, 2) whether the left and the right edge of each box (B, 4) is within or just beside a nearer box. Detectors
    end the box of a vehicle where a nearer one begins, and the LiDAR looks past it from another place."""
    x1, y1, x2, y2 = box.T[:, :, None]
    beside = HIDDEN_SHARE * (x2 - x1)
    in_front = nearer(box) & (y1 < y2.T) & (y2 > y1.T)
    at = [in_front & (x1.T - beside < x) & (x < x2.T + beside) for x in (x1, x2)]
    return np.stack([each.any(axis=1) for each in at], axis=1)


def _cluster_spans(tracks: Sequence[LidarTrack], start: F64, road: RoadProfile | None) -> F64:
    """(T, 7) left and right azimuth and elevation of the foot as the camera sees them; +1 if the left edge is at the
    near face, −1 if the right one is, 0 if that is not clear; rate of its bearing, range; standard deviation of the
    foot's elevation for that of the road; degrees and metres."""
    corners, road_sigma_m = corners_of([each.obstacle.cuboid for each in tracks]), np.zeros(len(tracks))
    if road is not None:
        # the planes under the clusters have steps, and beyond their returns no curvature
        beside = np.abs(corners[:, :4, 1]) < ASIDE_M + BESIDE_M
        corners[:, :4, 2] = np.where(beside, road.height(corners[:, :4, :2]), corners[:, :4, 2])
        nearest_x = corners[:, :4, 0].min(axis=1)
        road_sigma_m = np.where(beside.any(axis=1), road.height_sigma_m(nearest_x), 0.0)
    from_camera = corners - start
    azimuth = np.degrees(np.arctan2(from_camera[..., 1], from_camera[..., 0]))
    feet = from_camera[:, :4]
    foot = np.degrees(np.arctan2(feet[..., 2], np.hypot(feet[..., 0], feet[..., 1]))).min(axis=1)
    yaw = np.degrees([each.obstacle.cuboid.yaw_rad for each in tracks])
    # against the line of sight; a box is the same after a quarter of a turn
    turned = np.mod(yaw - azimuth[:, :4].mean(axis=1) + 45.0, 90.0) - 45.0
    near = np.where(np.abs(turned) > FACING_DEG, -np.sign(turned), 0.0)
    middle = np.array([each.obstacle.cuboid.center[:2] for each in tracks])
    velocity = np.array([each.velocity_mps or (0.0, 0.0) for each in tracks])
    squared = np.maximum(np.sum(middle**2, axis=1), 1.0)
    rate = np.degrees((middle[:, 0] * velocity[:, 1] - middle[:, 1] * velocity[:, 0]) / squared)
    range_m = np.hypot(from_camera[..., 0], from_camera[..., 1]).min(axis=1)
    left, right = azimuth.max(axis=1) + HALF_BEAM_DEG, azimuth.min(axis=1) - HALF_BEAM_DEG
    return np.column_stack([left, right, foot, near, rate, range_m, np.degrees(road_sigma_m / range_m)])


def _candidates(spans: F64, edges: F64) -> tuple[np.ndarray, np.ndarray]:
    """Rows of clusters and boxes that could be the same vehicle by their sizes."""
    height_m = np.tan(np.radians(edges[:, 3] - edges[:, 2]))[None] * spans[:, 5:6]
    share = (spans[:, 0] - spans[:, 1])[:, None] / (edges[:, 0] - edges[:, 1])[None]
    fits = (height_m > LOWEST_M) & (height_m < HIGHEST_M) & (share > NARROWEST) & (share < WIDEST)
    fits &= (np.abs(spans[:, 4]) < FASTEST_DEGPS)[:, None]
    track, box = np.nonzero(fits)
    return track, box


def _yaws(spans: F64, edges: F64) -> tuple[F64, Mask]:
    """(P,) yaw of each pair, and whether it tells one.

    Of a vehicle that stands at an angle to the line of sight, one edge of the box is at the far end of its side, which
    the LiDAR rarely hits; the other edge is at the corner of its near face in both. Unless the widths are the same,
    only the latter is used. For a vehicle parallel to the camera's axis it is the outer edge, but in a bend, where all
    vehicles ahead are turned the same way, it is the inner one. An edge that something nearer may hide is none.
    """
    left, right = spans[:, 0] - edges[:, 0], spans[:, 1] - edges[:, 1]
    share = (spans[:, 0] - spans[:, 1]) / (edges[:, 0] - edges[:, 1])
    hides_left, hides_right = edges[:, 4] > 0.0, edges[:, 5] > 0.0
    is_same = (np.abs(share - 1.0) < SAME_WIDTH) & ~hides_left & ~hides_right
    by_left, by_right = (spans[:, 3] > 0.0) & ~hides_left, (spans[:, 3] < 0.0) & ~hides_right
    yaw = np.where(is_same, (left + right) / 2, np.where(by_left, left, right))
    return yaw, is_same | by_left | by_right


def _agreeing(track: np.ndarray, box: np.ndarray, votes: F64, held: tuple[float, float]) -> list[int]:
    """Rows of the pairs, one for each cluster and each box at most, nearest to the angle that most of them support."""
    angles = np.vstack([[held], votes])
    near = np.exp(-0.5 * np.sum((angles[:, None] - votes[None]) ** 2, axis=2) / AGREE_DEG**2)
    support = np.zeros((len(angles), int(track.max(initial=-1)) + 1))
    for k, number in enumerate(track.tolist()):
        np.maximum(support[:, number], near[:, k], out=support[:, number])
    total = support.sum(axis=1)
    total[0] += KEPT
    away = np.sum((votes - angles[int(total.argmax())]) ** 2, axis=1)
    chosen: list[int] = []
    for k in np.argsort(away, kind="stable").tolist():
        if track[k] not in track[chosen] and box[k] not in box[chosen]:
            chosen.append(k)
    return chosen
