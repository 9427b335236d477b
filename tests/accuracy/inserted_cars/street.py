"""The street, and a car put into its images and sweeps.

The image gets the car's cut-out, scaled to the size that its rear has there. The sweep gets what the LiDAR's own rays
would have hit: the points on their way are moved onto the car, and rays that returned nothing are added.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from pipeline.alignment.projection import resolve
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import F64
from pipeline.params import AlignmentParams
from pipeline.sources import open_source
from pipeline.sources.driven_way import DrivenWay
from pipeline.types import U8, Frame, Sweep
from tests.accuracy.drives import FOLDERS
from tests.accuracy.inserted_cars.cut_outs import CutOut

URI = f"kitti:{data_dir() / FOLDERS['street']}"
_BRIGHTER, _LIGHT = 1.5, 8.0
"""Astyx's winter light → that of a summer's day."""
_SHADOW = 0.6
_STRAIGHT_ON_M = 150.0
_HEIGHTS_AT_M = np.arange(5.0, 45.0, 2.5)
_ROAD_HALF_M, _LOWEST_PERCENT, _FEWEST = 1.6, 15, 8
_ASIDE_M = 12.0
"""The street is straight: its road lies within this of the car's axis."""
_RANGE_NOISE_M, _LOST, _LOST_IN_GLASS = 0.02, 0.07, 0.6
_FARTHEST_HIT_M = 90.0
_STEP_RAD, _GAP_RAD = np.radians(0.17), np.radians(0.13)
"""Azimuth step of the HDL-64, and the gap between returns from which one is missing."""
_BODY, _CLEARANCE_M = 0.58, 0.25
"""The body's share of a car's height; the cabin is above."""
_CABIN_FROM, _CABIN_TO, _CABIN_NARROWER_M = 0.12, 0.7, 0.1


class Street:
    """KITTI 0009 at the rings of a VLP-16."""

    def __init__(self) -> None:
        source, dense = open_source(URI, rings=16), open_source(URI, rings=64)
        self.frames = [source.frame(index) for index in range(len(source))]
        self.time_s = np.array([frame.t_ns for frame in self.frames]) / 1e9
        self.time_s -= self.time_s[0]
        way = DrivenWay.of(source)
        self.ways = [_straight_on(way.ahead(index)) for index in range(len(source))]
        self.speed_mps = np.array([frame.ego.speed_mps for frame in self.frames if frame.ego is not None])
        steps = 0.5 * (self.speed_mps[1:] + self.speed_mps[:-1]) * np.diff(self.time_s)
        self.travelled_m = np.concatenate([[0.0], np.cumsum(steps)])
        self._heights = [_slope(dense.frame(index).sweep, self.ways[index]) for index in range(len(dense))]

    def at(self, index: int, along_m: float) -> tuple[F64, float]:
        """(2,) ego x, y of the way then driven, and its direction there."""
        way = self.ways[index]
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
        k = min(int(np.searchsorted(s, along_m, "right")) - 1, len(way) - 2)
        direction = way[k + 1] - way[k]
        place = np.array([np.interp(along_m, s, way[:, 0]), np.interp(along_m, s, way[:, 1])])
        return place, float(np.arctan2(direction[1], direction[0]))

    def height_m(self, index: int, along_m: float) -> float:
        """The road's height there, in the ego frame."""
        return float(np.polyval(self._heights[index], along_m))

    def with_car(
        self, index: int, car: CutOut, along_m: float, aside_m: float, rng: np.random.Generator
    ) -> tuple[Frame, F64]:
        """The frame with a car whose near face is at this distance along the way and aside of it (positive to the
        left), parallel to it; and (2,) the middle of that face, ego x, y."""
        frame = self.frames[index]
        place, heading = self.at(index, along_m)
        left = np.array([-np.sin(heading), np.cos(heading)])
        near, road_z_m = place + aside_m * left, self.height_m(index, along_m)
        assert frame.image is not None
        assert frame.sweep is not None
        aligned = resolve(AlignmentParams(), frame.camera)
        assert aligned is not None
        _, width, height = car.size
        face = [[*(near + side * width / 2 * left), road_z_m + z] for side in (1, -1) for z in (0.0, height)]
        uv = aligned.project(np.array(face))
        top, bottom = float(uv[[1, 3], 1].mean()), float(uv[[0, 2], 1].mean())
        bgr = _pasted(frame.image.bgr, car, (float(uv[:, 0].min()), top, float(uv[:, 0].max()), bottom))
        middle = np.array([*(near + 0.5 * car.size[0] * np.array([left[1], -left[0]])), road_z_m])
        sweep = _hit(frame.sweep, middle, heading, car.size, rng)
        return replace(frame, image=replace(frame.image, bgr=bgr, encoded=None), sweep=sweep), near


@cache
def street() -> Street:
    """Read once."""
    return Street()


def _straight_on(way: F64) -> F64:
    """The way, and straight on beyond the end of the recording: so does the street."""
    way = way if len(way) > 1 else np.array([[0.0, 0.0], [1.0, 0.0]])
    last = way[-1] - way[max(0, len(way) - 8)]
    return np.vstack([way, way[-1] + last / np.hypot(*last) * _STRAIGHT_ON_M])


def _slope(sweep: Sweep | None, way: F64) -> F64:
    """(2,) slope and height of the road along the way, by the lowest points on it."""
    assert sweep is not None
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    points, found = sweep.points[(sweep.points[:, 0] > 0.0) & (np.abs(sweep.points[:, 1]) < _ASIDE_M)], []
    for at_m in _HEIGHTS_AT_M:
        place = [np.interp(at_m, s, way[:, 0]), np.interp(at_m, s, way[:, 1])]
        z = points[np.hypot(*(points[:, :2] - place).T) < _ROAD_HALF_M, 2]
        if len(z) > _FEWEST:
            found.append((at_m, np.percentile(z, _LOWEST_PERCENT)))
    rows = np.array(found)
    line = np.polyfit(rows[:, 0], rows[:, 1], 1)
    on_road = np.abs(np.polyval(line, rows[:, 0]) - rows[:, 1]) < 0.15
    return np.asarray(np.polyfit(*rows[on_road].T, 1))


def _pasted(bgr: U8, car: CutOut, box: tuple[float, float, float, float]) -> U8:
    """The image with the car in a box x1 y1 x2 y2, and its shadow."""
    x1, y1 = round(box[0]), round(box[1])
    width, height = max(2, round(box[2] - box[0])), max(2, round(box[3] - box[1]))
    shadow = np.zeros(bgr.shape[:2], np.float32)
    axes = (round(0.52 * width), max(1, round(0.07 * height)))
    cv2.ellipse(shadow, (x1 + width // 2, round(box[3])), axes, 0.0, 0.0, 360.0, 1.0, -1)
    shadow = cv2.GaussianBlur(shadow, (0, 0), max(1.0, 0.03 * height))
    out = bgr * (1.0 - _SHADOW * shadow[..., None])
    scaled = cv2.resize(car.bgr, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32) * _BRIGHTER + _LIGHT
    alpha = cv2.GaussianBlur(
        cv2.resize(car.mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA), (0, 0), 0.6
    )
    left, top = max(x1, 0), max(y1, 0)
    right, bottom = min(x1 + width, bgr.shape[1]), min(y1 + height, bgr.shape[0])
    if right > left and bottom > top:
        part = np.s_[top - y1 : bottom - y1, left - x1 : right - x1]
        share = alpha[part][..., None]
        out[top:bottom, left:right] = out[top:bottom, left:right] * (1.0 - share) + scaled[part] * share
    return np.clip(out, 0.0, 255.0).astype(np.uint8)


def _hit(
    sweep: Sweep, middle: F64, heading: float, size: tuple[float, float, float], rng: np.random.Generator
) -> Sweep:
    """The sweep with a car at ``middle`` (x, y of its centre, z of the road)."""
    origin = np.array(sweep.origin)
    rays = sweep.points[:, :3].astype(np.float64) - origin
    ranges = np.linalg.norm(rays, axis=1)
    rays = rays / ranges[:, None]
    empty, empty_ring = _empty_rays(rays, sweep.ring, float(np.arctan2(middle[1] - origin[1], middle[0] - origin[0])))
    rays = np.vstack([rays, empty])
    ranges = np.concatenate([ranges, np.full(len(empty), np.inf)])
    hit_m, is_glass = _on_car(origin, rays, middle, heading, size)
    is_hit = hit_m < np.minimum(ranges, _FARTHEST_HIT_M)
    lost = rng.random(len(rays)) < np.where(is_glass, _LOST_IN_GLASS, _LOST)
    kept = np.where(is_hit, ~lost, np.isfinite(ranges))
    far = np.where(is_hit, hit_m + rng.normal(0.0, _RANGE_NOISE_M, len(rays)), ranges)[kept]
    value = np.concatenate([sweep.points[:, 3], np.full(len(empty), 0.3)])[kept]
    points = np.column_stack([origin + rays[kept] * far[:, None], value]).astype(np.float32)
    time_s = None
    if sweep.time_s is not None:
        time_s = np.concatenate([sweep.time_s, np.zeros(len(empty), np.float32)])[kept]
    return replace(sweep, points=points, ring=np.concatenate([sweep.ring, empty_ring])[kept], time_s=time_s)


def _empty_rays(rays: F64, ring: U8, towards_rad: float) -> tuple[F64, U8]:
    """(E, 3) directions towards the car in which a ring returned nothing, and their rings."""
    azimuth, elevation = np.arctan2(rays[:, 1], rays[:, 0]), np.arcsin(rays[:, 2])
    found, rings = [np.zeros((0, 3))], [np.zeros(0, np.uint8)]
    for each in np.unique(ring):
        near = (ring == each) & (np.abs(azimuth - towards_rad) < 0.5)
        if near.sum() < 20:
            continue
        there = np.sort(azimuth[near])
        wanted = np.arange(towards_rad - 0.45, towards_rad + 0.45, _STEP_RAD)
        k = np.clip(np.searchsorted(there, wanted), 1, len(there) - 1)
        wanted = wanted[np.minimum(np.abs(there[k] - wanted), np.abs(there[k - 1] - wanted)) > _GAP_RAD]
        up = float(np.median(elevation[near]))
        level = np.column_stack([np.cos(wanted), np.sin(wanted)]) * np.cos(up)
        found.append(np.column_stack([level, np.full(len(wanted), np.sin(up))]))
        rings.append(np.full(len(wanted), each, np.uint8))
    return np.vstack(found), np.concatenate(rings)


def _on_car(
    origin: F64, rays: F64, middle: F64, heading: float, size: tuple[float, float, float]
) -> tuple[F64, np.ndarray]:
    """(N,) distance to a body and a cabin, infinite beside them; (N,) whether the cabin is hit."""
    cos, sin = np.cos(heading), np.sin(heading)
    to_car = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    start, rays = to_car @ (origin - middle), rays @ to_car.T
    length, width, height = size
    half, side = length / 2, width / 2
    body = _box(start, rays, np.array([-half, -side, _CLEARANCE_M]), np.array([half, side, _BODY * height]))
    side -= _CABIN_NARROWER_M
    low = np.array([(_CABIN_FROM - 0.5) * length, -side, _BODY * height])
    cabin = _box(start, rays, low, np.array([(_CABIN_TO - 0.5) * length, side, height]))
    return np.minimum(body, cabin), cabin < body


def _box(start: F64, rays: F64, low: F64, high: F64) -> F64:
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - start) / rays, (high - start) / rays
    enters = np.nanmax(np.minimum(first, second), axis=1)
    leaves = np.nanmin(np.maximum(first, second), axis=1)
    return np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)
