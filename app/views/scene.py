"""What the 3D views share: colours, texts and outlines of a ``Result``. Nothing here computes perception.

Ego frame, metres. Colours are 0–255. Each function reads a result and returns arrays that a view passes to its library.
"""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from app.views.colors import Rgb, rgb, role_of, shade_of
from pipeline.common.geometry import Cuboid
from pipeline.lanes.drawn_lines import polylines
from pipeline.types import DROPPED, F64, GROUND, UNCLUSTERED, FusedObject, Path, Point3, Result

U8 = npt.NDArray[np.uint8]
ColorBy = Literal["kind", "height", "intensity", "range"]

EGO_LENGTH_M, EGO_WIDTH_M, EGO_HEIGHT_M = 4.5, 1.8, 1.5
"""Typical size of a car, drawn behind the sensor: the paper mounts the LiDAR on the front bumper."""
_LABEL_LIFT_M, _FLAT_LABEL_LIFT_M = 0.5, 1.2
_HEIGHT_SPAN_M = (-0.3, 3.0)
_RANGE_SPAN_M = (0.0, 80.0)
_BRIGHTEST_PERCENTILE = 98.0


def cipv_id(result: Result) -> int | None:
    """The id of the closest in-path vehicle, if there is one."""
    return None if result.cipv is None else result.cipv.id


def object_color(each: FusedObject, result: Result) -> Rgb:
    """Green for the CIPV, else by the sensors that see the object; a carried object is half as bright."""
    color = rgb(role_of(each, cipv_id(result)))
    return (color[0] // 2, color[1] // 2, color[2] // 2) if each.carried else color


def object_text(each: FusedObject) -> str:
    """``#7 car 23.4 m``; ``?`` if the distance is unknown, with ``carried`` if the object was not seen."""
    distance = "? m" if each.distance_m is None else f"{each.distance_m:.1f} m"
    return f"#{each.id} {each.label or 'obstacle'} {distance}{' carried' if each.carried else ''}"


def stands_out(each: FusedObject, result: Result) -> bool:
    """Whether an object gets a name and a velocity arrow: the CIPV, and objects in the path or seen by the camera now;
    no poles and no carried objects, since labels for all objects would fill the view."""
    return each.id == cipv_id(result) or (not each.carried and (each.imaged or each.in_path))


def top_of(each: FusedObject, floor_m: float) -> Point3:
    """Position of an object's label: above its middle."""
    x, y = np.asarray(each.bev).mean(axis=0)
    if each.cuboid is None:
        return float(x), float(y), floor_m + _FLAT_LABEL_LIFT_M
    return float(x), float(y), each.cuboid.center[2] + each.cuboid.size[2] / 2 + _LABEL_LIFT_M


def owners(result: Result) -> dict[int, FusedObject]:
    """The object of each LiDAR cluster of this sweep, by cluster index."""
    by_track = {each.lidar_track: each for each in result.objects if each.lidar_track is not None}
    return {
        track.obstacle.cluster: by_track[track.id]
        for track in result.layers.lidar_tracks
        if not track.carried and track.id in by_track
    }


def point_colors(result: Result, by: ColorBy = "kind") -> U8:
    """(N, 3) RGB, one per point of ``result.layers.points``.

    kind: grey ground, dim unclustered points, clusters in their object's colour. The others use a continuous colour
    scale: height above the ground, intensity up to its 98th percentile, horizontal range up to 80 m.
    """
    points = result.layers.points
    if by == "kind":
        return _kind_colors(result)
    if by == "height":
        return _scale(_heights_m(result), *_HEIGHT_SPAN_M)
    if by == "range":
        return range_colors(np.hypot(points[:, 0], points[:, 1]))
    brightest = float(np.percentile(points[:, 3], _BRIGHTEST_PERCENTILE)) if len(points) else 0.0
    return _scale(points[:, 3], 0.0, max(brightest, 1e-6))


def range_colors(range_m: npt.NDArray[np.floating]) -> U8:
    """(N, 3) RGB of (N,) horizontal ranges: near is blue, far is red."""
    return _scale(range_m, *_RANGE_SPAN_M)


def _kind_colors(result: Result) -> U8:
    kind = result.layers.kind
    table = np.empty((max(int(kind.max(initial=-1)) + 1, 0), 3), dtype=np.uint8)
    table[:] = rgb("cluster")
    cipv = cipv_id(result)
    for cluster, owner in owners(result).items():
        if cluster < len(table):
            table[cluster] = shade_of(rgb(role_of(owner, cipv)), owner.id)
    colors = np.empty((len(kind), 3), dtype=np.uint8)
    colors[kind == GROUND] = rgb("ground")
    colors[kind == UNCLUSTERED] = rgb("unclustered")
    colors[kind == DROPPED] = rgb("dropped")
    clustered = kind >= 0
    colors[clustered] = table[kind[clustered]]
    return colors


def _scale(values: npt.NDArray[np.floating], low: float, high: float) -> U8:
    if not len(values):
        return np.empty((0, 3), dtype=np.uint8)
    levels = np.clip((values - low) / (high - low) * 255.0, 0.0, 255.0).astype(np.uint8)
    return np.ascontiguousarray(cv2.applyColorMap(levels[:, None], cv2.COLORMAP_TURBO)[:, 0, ::-1])


def ground_height_m(result: Result) -> float | None:
    """Height of the fitted ground at the ego origin; None without one, for example without a sweep."""
    ground = result.layers.ground
    if ground is None:
        return None
    height_m = float(ground.height(np.zeros((1, 2)))[0])
    return height_m if np.isfinite(height_m) else None


def _heights_m(result: Result) -> npt.NDArray[np.floating]:
    """(N,) heights of the points above the ground, or above the ego origin without a fitted ground."""
    points, ground = result.layers.points, result.layers.ground
    above = points[:, 2].astype(np.float64) if ground is None else ground.above(points)
    return np.where(np.isfinite(above), above, points[:, 2])


def lane_lines(result: Result) -> list[F64]:
    """(K, 2) ego x y of each detected line of the ego lane."""
    return list(polylines(result.layers.lanes).values()) if result.layers.lanes is not None else []


def cuboid_edges(cuboid: Cuboid) -> F64:
    """(12, 2, 3) the twelve edges as start and end points."""
    corners = cuboid.corners()
    low, high = np.arange(4), np.arange(4, 8)
    rings = [np.stack([corners[ring], corners[np.roll(ring, -1)]], axis=1) for ring in (low, high)]
    return np.concatenate([*rings, np.stack([corners[low], corners[high]], axis=1)])


def ego_cuboid(ground_m: float) -> Cuboid:
    """The ego car standing on the ground behind the sensor."""
    center = (-EGO_LENGTH_M / 2, 0.0, ground_m + EGO_HEIGHT_M / 2)
    return Cuboid(center, (EGO_LENGTH_M, EGO_WIDTH_M, EGO_HEIGHT_M), 0.0)


def flat_outline(each: FusedObject, height_m: float) -> F64 | None:
    """(5, 3) closed outline of an object's footprint at a height; None if its position is unknown."""
    if each.bev is None:
        return None
    ring = np.asarray([*each.bev, each.bev[0]], dtype=np.float64)
    return np.column_stack([ring, np.full(5, height_m)])


def on_ground(line: F64, height_m: float) -> F64:
    """(K, 3) an ego x, y polyline (K, 2) placed at a height."""
    return np.column_stack([line, np.full(len(line), height_m)])


def ribbon(path: Path, height_m: float) -> tuple[F64, npt.NDArray[np.int32]]:
    """The corridor as a strip of triangles: (2K, 3) vertices, left side first, and (2K−2, 3) vertex indices."""
    count = min(len(path.left), len(path.right))
    vertices = np.vstack([on_ground(path.left[:count], height_m), on_ground(path.right[:count], height_m)])
    left = np.arange(max(count - 1, 0), dtype=np.int32)
    right = left + count
    faces = np.vstack([np.column_stack([left, right, left + 1]), np.column_stack([right, right + 1, left + 1])])
    return vertices, faces.astype(np.int32)
