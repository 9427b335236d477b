"""How the lower edge of a box fits the road, at each distance that the vehicle may have.

A distance from the height of a box is only as good as the assumed height of the vehicle: a van that is classified as a
car is placed a third too near, a truck at half of its distance. The lower edge of the box needs no such assumption. It
is where the tyres touch the road, whose height the LiDAR measures (Stein, Mano, Shashua, IV 2003, on a flat road). The
pitch of the car does not matter, because both sensors pitch with it. The remaining errors are the shape of the road
beyond its last return (``pipeline.lidar.road_profile``) and the noise of the edge.

The road is known well nearby and hardly at all at 100 m. So where a line of sight meets it says little about a truck at
100 m, but that it passes a metre above the road at 40 m says for sure that this is no car at 40 m. Therefore the edge
is compared with the road at each distance, with the uncertainty that the road has there; what follows for the height of
the vehicle is decided in ``pipeline.vision.vehicle_height``.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.fusion.boxes_in_front import EDGE_PX, nearer
from pipeline.lidar.road_profile import ASIDE_M, RoadProfile, fit_road_profile
from pipeline.params import FusionParams
from pipeline.types import F32, VEHICLES, Ground, Mask, RoadSight, VisionMeasurement
from pipeline.vision.vehicle_height import HEIGHT_RATIOS

NEAREST_M = 10.0
"""Minimum distance by the box's height. Nearer, the lower edge is as often a shadow as a tyre
(``pipeline.vision.vehicle_height``)."""
_FLOOR_SHARE = 0.07
"""Standard deviation of the edge, as a share of the box's height, because it is drawn at the axle, the bumper or the
shadow. A car is about as tall as the camera is high, so its distance is off by the same share; that of a lorry by twice
as much. With this value, one sigma covers 76 and 79 % of the errors, and two sigmas 94 %, of labelled vehicles on Astyx
and KITTI 0009 at 20–30 m, where the road is known; beyond that, 86 and 94 % or more."""
_PITCH_SIGMA_RAD = np.radians(0.15)
"""Standard deviation of the alignment between the sensors. A fit to traffic determines its pitch to within so much from
nine of ten starts (docs/reference/accuracy-alignment.md); a calibration target is more accurate."""
_HIDDEN_SHARE = 0.3
"""Covered share of a box's lower edge above which the network draws it where the nearer vehicle begins."""


_NEAREST_WAY_M = 1.0
"""Nothing begins nearer to the camera."""


def road_ahead(
    points: F32,
    ground: Ground | None,
    boxes: tuple[VisionMeasurement, ...] | None,
    alignment: Alignment | None,
    speed_mps: float | None = None,
) -> RoadProfile | None:
    """The road in a sweep, as far as no vehicle in the image covers it; None without a sweep or boxes.

    Over a crest, the road falls away, and a ring on the rear of a far car lies where the flat road would be: to the
    LiDAR alone it is road. points: (N, 4) float32 ``x y z intensity``, ego frame.
    """
    if ground is None or not boxes:
        return None
    mask = ground.mask
    bbox = np.array([each.detection.bbox for each in boxes if each.detection.label in VEHICLES])
    rows = np.flatnonzero(mask & (points[:, 0] > NEAREST_M) & (np.abs(points[:, 1]) < ASIDE_M))
    if alignment is not None and len(bbox) and len(rows):
        u, v = alignment.project(points[rows, :3].astype(np.float64)).T[:, :, None]
        x1, y1, x2, y2 = bbox.T
        with np.errstate(invalid="ignore"):
            covered = ((u > x1) & (u < x2) & (v > y1) & (v < y2 - EDGE_PX)).any(axis=1)
        mask = mask.copy()
        mask[rows[covered]] = False
    return fit_road_profile(points, mask, speed_mps)


def measure_contacts(
    boxes: tuple[VisionMeasurement, ...] | None,
    road: RoadProfile | None,
    alignment: Alignment | None,
    params: FusionParams,
) -> tuple[VisionMeasurement, ...] | None:
    """The boxes, with ``road`` for vehicles whose lower edge is visible. road: None while unknown; then no box has
    any."""
    if not params.use_ground_contact or not boxes or alignment is None or not alignment.is_metric or road is None:
        return boxes
    bbox = np.array([each.detection.bbox for each in boxes])
    law_m = np.array([each.distance_m or 0.0 for each in boxes])
    is_vehicle = np.array([each.detection.label in VEHICLES for each in boxes])
    rows = np.flatnonzero(is_vehicle & (law_m >= NEAREST_M) & ~_hidden_below(bbox))
    if not len(rows):
        return boxes
    measured = list(boxes)
    for row, sight in zip(rows.tolist(), _sights(bbox[rows], law_m[rows], alignment, road), strict=True):
        measured[row] = evolve(boxes[row], road=sight)
    return tuple(measured)


def _sights(bbox: F64, law_m: F64, alignment: Alignment, road: RoadProfile) -> Iterator[RoadSight | None]:
    """How the lower edge of each box (M, 4) fits the road; None for those beside the known strip. law_m: (M,) distance
    of a vehicle as tall as its class."""
    middle, upper, lower = (bbox[:, 0] + bbox[:, 2]) / 2.0, bbox[:, 1], bbox[:, 3]
    eye, rays = alignment.rays(np.column_stack([middle, lower]))
    along = rays / np.hypot(rays[:, 0], rays[:, 1])[:, None]
    range_m = law_m[:, None] * np.exp(HEIGHT_RATIOS)
    back = along[:, :2] @ eye[:2]
    # a camera far behind the bumper may be farther from it than the nearest of the vehicle's possible places
    way_m = np.sqrt(np.maximum(range_m**2 + (back**2 - eye[:2] @ eye[:2])[:, None], 0.0)) - back[:, None]
    way_m = np.maximum(way_m, _NEAREST_WAY_M)
    place = eye + along[:, None] * way_m[:, :, None]  # (M, G, 3): on the line of sight, where the vehicle would begin
    above = (place[:, :, 2] - road.height(place)) / way_m
    tall = np.abs(_elevation(alignment, middle, upper) - along[:, 2])
    noise = (_elevation(alignment, middle, lower - EDGE_PX) - _elevation(alignment, middle, lower + EDGE_PX)) / 2.0
    by_road = road.height_sigma_m(place[:, :, 0].ravel()).reshape(way_m.shape) / way_m
    lasting = np.sqrt(by_road**2 + _PITCH_SIGMA_RAD**2 + (_FLOOR_SHARE * tall[:, None]) ** 2)
    is_known = np.abs(along[:, 1] * law_m) < ASIDE_M
    for row, known in enumerate(is_known.tolist()):
        yield RoadSight(above[row], lasting[row], float(abs(noise[row])), float(tall[row])) if known else None


def _hidden_below(bbox: F64) -> Mask:
    """(M,) whether a nearer box covers much of the lower edge of a box (M, 4). Two boxes on one vehicle do not."""
    x1, y1, x2, y2 = bbox.T[:, :, None]
    covered = (np.minimum(x2, x2.T) - np.maximum(x1, x1.T)) / np.maximum(x2 - x1, 1.0)
    hidden: Mask = (nearer(bbox) & (y2 > y1.T) & (covered > _HIDDEN_SHARE)).any(axis=1)
    return hidden


def _elevation(alignment: Alignment, u: F64, v: F64) -> F64:
    """(M,) slope of the lines of sight of pixels u, v (M,): rise per horizontal metre."""
    _, rays = alignment.rays(np.column_stack([u, v]))
    slope: F64 = rays[:, 2] / np.hypot(rays[:, 0], rays[:, 1])
    return slope
