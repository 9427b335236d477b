"""Converts a lane detector's points in the image to lines on the road in metres.

``measure``  points of one image → ground → lines, with the pitch that makes them parallel
``follow``   the same, with the lines tracked from frame to frame: the stage that ``step`` runs

The road is a plane: the one fitted to the LiDAR's ground points, or else as far below the ego origin as the calibration
or the parameter says. Lines of a road are parallel, so an error of the camera's pitch shows as a change of their
distance with range. The error is tracked as a slow state.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import Alignment
from pipeline.common.fast_replace import evolve
from pipeline.common.geometry import F64
from pipeline.lanes import line_fit, tracking
from pipeline.lanes.line_fit import FittedLine, RoadCurve, Sightings
from pipeline.lidar.ground import Ground
from pipeline.params import LaneParams
from pipeline.types import I32, Box, Moment, RawLanes
from pipeline.types.lane import EgoLane, powers

Seed = tuple[float, Sightings]

_MIN_POINTS = 12
_NEAR_M, _FAR_M = 5.0, 12.0
"""Range in which the road's height is taken from the LiDAR's ground: its rings are dense there."""
_PLANE_GAIN = 0.1
"""Weight of one sweep in the running mean of the road's plane: one fit has an error of centimetres, and the car's pitch
changes slowly."""
_UNPARALLEL = 0.004
"""Real lines of one road differ in heading by this much, radians."""
_HEADING_AT_M = 15.0
_HEADING = np.array([0.0, 1.0, 2.0 * _HEADING_AT_M, 3.0 * _HEADING_AT_M**2])
"""Derivative dy/dx of a line there, as a function of its coefficients."""
_FLATNESS_RAD = 0.003
"""A vertical curve of the road ahead appears as this much pitch."""
_STRAY_M = 9.0
"""Lines farther to the side are ignored."""
_HOPELESS = 0.05
_BEYOND = 0.6
"""Points beyond ``max_range_m`` may be nearer with another pitch, so points are kept down to this share of its
inverse."""
_COMPARED = powers(10.0)
_APART_M = 0.6
"""Two lines nearer to each other than this, ten metres ahead, are one."""
_VEHICLE_MARGIN = 0.1
"""Share of a box's width left out at either side of it."""


@dataclass(frozen=True)
class Pitch:
    """The camera's pitch relative to its calibration."""

    rad: float
    """Positive downwards."""
    sigma_rad: float
    """Standard deviation."""


@dataclass(frozen=True, eq=False)
class LaneMeasurement:
    """The lines of one image in the ego frame, strongest first, and the pitch used to map them."""

    source: str
    """Name of the detector."""
    lines: tuple[FittedLine, ...]
    """Strongest first."""
    pitch: Pitch
    """Pitch used to map the lines to the ground."""
    age_s: float = 0.0
    """How much older their image is than the frame."""


@dataclass(frozen=True, eq=False)
class LaneState:
    """State from one frame to the next."""

    tracks: tracking.LaneTracks = tracking.LaneTracks()
    """Every tracked line."""
    pitch: Pitch | None = None
    """Current estimate of the camera's pitch; None before the first frame."""
    plane: F64 | None = None
    """(3,) a, b, c of the road z = a·x + b·y + c, a running mean over the sweeps in which it was visible; None before
    the first of them."""
    sweeps: int = 0
    """Number of sweeps in which it was visible."""
    measured: LaneMeasurement | None = None
    """The lines of this frame's image, before tracking; None if it was not processed."""


class RoadView(NamedTuple):
    """Geometry of the road in one image."""

    aligned: Alignment | None
    """Projection of ego points into the image; None if not known, and nothing can be measured."""
    ground: Ground | None = None
    """The ground of this frame's sweep, if any."""
    road_z_m: float | None = None
    """Height of the road below the car in the ego frame, from the calibration; None to use the parameter."""
    vehicles: Sequence[Box] = ()
    """Image boxes of vehicles that hide the road, pixels."""


def follow(
    state: LaneState, raw: RawLanes | None, view: RoadView, now: Moment, params: LaneParams
) -> tuple[LaneState, EgoLane | None]:
    """One frame: measure if a lane detector has processed it or, more recently than the last frame, an earlier image;
    and track. None before the first measurement."""
    plane, sweeps = _settled(state, road_plane(view.ground))
    road = _road(plane, view, params)

    # In front of a standing car only traffic moves, and the vehicle before it hides the lines
    if now.stands and state.pitch is not None and tracking.is_settled(state.tracks, params):
        lane = tracking.ego_lane(state.tracks, state.pitch.rad, road, params)
        return LaneState(state.tracks, state.pitch, plane, sweeps), lane

    # A processed image gives lines on the road, and the pitch for which they are parallel
    pitch = _drifted(state.pitch, now.dt_s, params)
    measured = None
    if raw is not None and view.aligned is not None and raw.age_s <= params.max_age_s:
        expected = tracking.expected_shape(state.tracks)
        measured = measure(_beside(raw, view.vehicles), view.aligned, road, pitch, params, expected)
        measured = evolve(measured, lines=tracking.moved(measured.lines, now.ego, raw.age_s))
        pitch = measured.pitch

    # Every line is tracked; the ego lane is the pair of lines around the car
    tracks = tracking.predict(state.tracks, now.ego, now.dt_s, params)
    if measured is not None:
        tracks = tracking.update(tracks, measured.source, measured.lines, params, measured.age_s)
    lane = tracking.ego_lane(tracks, pitch.rad, road, params)
    return LaneState(tracks, pitch, plane, sweeps, measured), lane


def measure(
    raw: RawLanes, aligned: Alignment, plane: F64, pitch: Pitch, params: LaneParams, expected: RoadCurve | None = None
) -> LaneMeasurement:
    """Lines on the road from points in the image; none if too few points lie on it.

    plane: (3,) as in ``LaneState``. pitch: estimate before this image. expected: the shape of the tracked lines, which
    narrows the search; None for a wide search.
    """
    raw = raw.painted()
    nothing = LaneMeasurement(raw.model, (), pitch, raw.age_s)
    eye, rays = aligned.rays(np.asarray(raw.points, np.float64))
    height_m = float(eye[2] - (plane[0] * eye[0] + plane[1] * eye[1] + plane[2]))
    if height_m <= 0.1:
        return nothing
    seen, line = _on_road(raw, rays, plane, height_m, params.max_range_m)
    if len(line) < _MIN_POINTS:
        return nothing
    reach = float(min(2.5 * pitch.sigma_rad, 0.045))
    around = evolve(expected or RoadCurve(), pitch_rad=pitch.rad, pitch_reach_rad=reach)
    shape, histogram = line_fit.shared_shape(seen, around)
    sigma = float(np.radians(params.bearing_sigma_deg))
    first = _fitted(_seeds(line, seen, shape, histogram), shape, sigma)
    pitch = _parallel([found for found, _ in first], height_m, shape.pitch_rad, pitch)
    shape = evolve(shape, pitch_rad=pitch.rad)
    again = [(float(found.coefficients[0]), points) for found, points in first]
    lines = [found for found, _ in _fitted(again, shape, sigma)]
    to_ego = tracking.shifted(-float(eye[0]))
    lines = [_in_ego(found, eye, to_ego, height_m, pitch) for found in _distinct(lines) if _plausible(found, params)]
    return LaneMeasurement(raw.model, tuple(lines), pitch, raw.age_s)


def road_edges(raw: RawLanes | None, view: RoadView, state: LaneState, now: Moment, params: LaneParams) -> F64 | None:
    """(M, 2) ego x, y on the edges of the drivable area; None if no detector looked for it.

    Args:
        raw: what the lane detector saw.
        view: of the frame's image.
        state: after ``follow`` in this frame: pitch and road.
        now: own motion, for what was seen in an earlier image.
        params: of lane tracking.
    """
    if raw is None or view.aligned is None or state.pitch is None or raw.age_s > params.max_age_s:
        return None
    edges = _beside(raw.road_edges(), [_wider(box) for box in view.vehicles])
    eye, rays = view.aligned.rays(np.asarray(edges.points, np.float64))
    plane = _road(state.plane, view, params)
    height_m = float(eye[2] - (plane[0] * eye[0] + plane[1] * eye[1] + plane[2]))
    if not len(edges.points) or height_m <= 0.1:
        return np.zeros((0, 2)) if len(raw.road_edges().points) else None
    seen, _ = _on_road(edges, rays, plane, height_m, params.max_range_m)
    x = seen.x_m(state.pitch.rad)
    edge = np.column_stack([x + eye[0], seen.slope * x + eye[1]])[(x > 0.0) & (x < params.max_range_m)]
    return tracking.moved_points(edge, now.ego, raw.age_s)


def _wider(box: Box) -> Box:
    """Around a vehicle, the drivable area ends at its wheels or its shadow, not at the road's edge."""
    margin = _VEHICLE_MARGIN * (box[2] - box[0])
    return (box[0] - margin, box[1], box[2] + margin, box[3] + margin)


def _road(plane: F64 | None, view: RoadView, params: LaneParams) -> F64:
    """(3,) the road: the plane of the LiDAR's ground, else the height from calibration or parameter."""
    level_m = view.road_z_m if view.road_z_m is not None else -params.mount_height_m
    return plane if plane is not None else np.array([0.0, 0.0, level_m])


def _beside(raw: RawLanes, vehicles: Sequence[Box]) -> RawLanes:
    """The points outside vehicles, whose edges and reflections look like paint."""
    if not vehicles or not len(raw.points):
        return raw
    u, v = raw.points.T[:, :, None]
    x1, y1, x2, y2 = np.array(vehicles).T
    free = ~np.any((u > x1) & (u < x2) & (v > y1) & (v < y2), axis=1)
    return raw.only(free)


def road_plane(ground: Ground | None) -> F64 | None:
    """(3,) a, b, c of the road's height z = a·x + b·y + c ahead, from the LiDAR's ground; None without one."""
    if ground is None:
        return None
    z = ground.height(np.array([[_NEAR_M, 0.0], [_FAR_M, 0.0], [_NEAR_M, 2.0], [_NEAR_M, -2.0]]))
    if not np.all(np.isfinite(z)):
        return None
    along = (z[1] - z[0]) / (_FAR_M - _NEAR_M)
    return np.array([along, (z[2] - z[3]) / 4.0, z[0] - along * _NEAR_M])


def _settled(state: LaneState, seen: F64 | None) -> tuple[F64 | None, int]:
    """The plane after one more sweep, and the number of sweeps."""
    if seen is None or state.plane is None:
        return (state.plane, state.sweeps) if seen is None else (seen, 1)
    gain = max(_PLANE_GAIN, 1.0 / (state.sweeps + 1))
    return state.plane + gain * (seen - state.plane), state.sweeps + 1


def warm_up() -> None:
    """Compile the kernels before the first image."""
    tracking.warm_up()
    seen = Sightings(np.zeros(20), np.linspace(0.05, 0.2, 20), np.ones(20), 1.0)
    shape, _ = line_fit.shared_shape(seen, RoadCurve())
    line_fit.fit_line(seen, 0.0, shape, 1e-3)


def _drifted(pitch: Pitch | None, dt_s: float | None, params: LaneParams) -> Pitch:
    """The predicted pitch: it decays towards its calibration and becomes less certain over time."""
    start = float(np.radians(params.pitch_sigma_deg))
    if pitch is None or dt_s is None:
        return Pitch(0.0, start)
    grown = float(np.hypot(pitch.sigma_rad, np.radians(params.pitch_drift_deg) * np.sqrt(dt_s)))
    return Pitch(pitch.rad, min(grown, start))


def _on_road(raw: RawLanes, rays: F64, plane: F64, height_m: float, max_range_m: float) -> tuple[Sightings, I32]:
    """Intersection of each ray with the road ahead, and the line of its point; rays without intersection are left out.
    In inverse distance, a ray near the horizon is no special case."""
    forward = np.maximum(rays[:, 0], 1e-6)
    slope = rays[:, 1] / forward
    inverse = (plane[0] + plane[1] * slope - rays[:, 2] / forward) / height_m
    ahead = (rays[:, 0] > 0) & (inverse > _BEYOND / max_range_m)
    return Sightings(slope[ahead], inverse[ahead], raw.scores[ahead].astype(np.float64), height_m), raw.line[ahead]


def _seeds(line: I32, seen: Sightings, shape: RoadCurve, histogram: F64) -> list[Seed]:
    """Position of each line at x = 0, and the points that may belong to it: those grouped by the detector, or without
    grouping, those near a peak of the histogram."""
    groups = sorted(set(line[line >= 0].tolist()))
    if not groups:
        return [(y0, seen) for y0 in line_fit.peaks(histogram)]
    x = seen.x_m(shape.pitch_rad)
    y0 = x * (seen.slope - shape.heading_rad - 0.5 * shape.curvature_per_m * x)
    return [(float(np.median(y0[line == group])), seen.only(line == group)) for group in groups]


def _fitted(seeds: list[Seed], shape: RoadCurve, bearing_sigma_rad: float) -> list[tuple[FittedLine, Sightings]]:
    """The line through each seed's points, with those points; failed fits are left out."""
    fits = [(line_fit.fit_line(points, y0, shape, bearing_sigma_rad), points) for y0, points in seeds]
    return [(found, points) for found, points in fits if found is not None and found.quality > _HOPELESS]


def _parallel(lines: list[FittedLine], height_m: float, tried_rad: float, before: Pitch) -> Pitch:
    """The pitch for which the lines are parallel, combined with the previous estimate.

    A pitch error p makes a line at lateral position c0 appear rotated by c0·p/h, so p/h is the slope of heading over
    position. The heading is evaluated in the middle of the visible part, where it is most accurate. Parallels of
    curvature κ are concentric: at x their headings differ by κ²·x per metre between them.
    """
    if len(lines) < 2:
        return before
    place = np.array([line.coefficients[0] for line in lines])
    heading = np.array([_HEADING @ line.coefficients for line in lines])
    variance_of = np.array([_HEADING @ line.covariance @ _HEADING for line in lines])
    trust = np.array([line.quality for line in lines]) / (variance_of + _UNPARALLEL**2)
    bend = float(trust @ [2.0 * line.coefficients[2] for line in lines]) / float(trust.sum())
    place = place - float(trust @ place) / float(trust.sum())
    heading = heading - bend * bend * _HEADING_AT_M * place
    spread = float(trust @ place**2)
    if spread <= 0.0:
        return before
    measured = tried_rad + height_m * float((trust * place) @ heading) / spread
    variance = height_m**2 / spread + _FLATNESS_RAD**2
    gain = before.sigma_rad**2 / (before.sigma_rad**2 + variance)
    return Pitch(before.rad + gain * (measured - before.rad), float(np.sqrt((1.0 - gain) * before.sigma_rad**2)))


def _distinct(lines: list[FittedLine]) -> list[FittedLine]:
    """Without lines that converged to a better one during the fit."""
    kept: list[FittedLine] = []
    places: list[float] = []
    for line in sorted(lines, key=lambda each: -each.quality):
        place = float(_COMPARED @ line.coefficients)
        if all(abs(place - other) > _APART_M for other in places):
            kept.append(line)
            places.append(place)
    return kept


def _plausible(line: FittedLine, params: LaneParams) -> bool:
    place, slope = float(line.coefficients[0]), float(line.coefficients[1])
    return abs(slope) <= math.tan(math.radians(params.max_heading_deg)) and abs(place) <= _STRAY_M


def _in_ego(line: FittedLine, eye: F64, to_ego: F64, height_m: float, pitch: Pitch) -> FittedLine:
    """Transforms a line from the foot of the camera to the ego origin; adds the uncertainty of the pitch to the
    covariance."""
    c0, _, c2, _ = line.coefficients
    by_pitch = np.array([0.0, -c0, 0.0, c2]) / height_m * pitch.sigma_rad
    mean = to_ego @ line.coefficients
    mean[0] += eye[1]
    cov = to_ego @ (line.covariance + by_pitch[:, None] * by_pitch) @ to_ego.T
    return FittedLine(mean, cov, line.x_min_m + float(eye[0]), line.x_max_m + float(eye[0]), line.quality)
