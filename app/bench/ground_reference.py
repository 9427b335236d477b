"""Ground fitting in plain numpy: the same method as ``pipeline.lidar.ground``, written in the obvious way. ``cipv
bench`` compares the speed of the compiled version with it, and a test compares the masks.
"""

from __future__ import annotations

import numpy as np

from pipeline.lidar import ground_kernels, plane_kernels
from pipeline.lidar.ground import Ground
from pipeline.params import GroundParams
from pipeline.types import F32, F64, Mask


def fit_ground_numpy(points: F32, keep: Mask, params: GroundParams) -> Ground:
    """Takes the same arguments and returns the same result as ``pipeline.lidar.ground.fit_ground``."""
    xyz = points[:, :3]
    x, y = xyz[:, 0], xyz[:, 1]
    inside = keep & (np.abs(x) < params.fit_range_m) & (np.abs(y) < params.fit_half_width_m)
    area = xyz[inside & (x * x + y * y >= np.float32(params.min_range_m**2))]
    edges = _edges(area[:, 0], params)
    segment = np.searchsorted(edges[1:-1].astype(np.float32), area[:, 0], side="right")
    parts = [area[segment == s] for s in range(params.segments)]
    planes, fitted = _fit(parts, edges, params)
    here = planes[np.searchsorted(edges[1:-1].astype(np.float32), x, side="right")]
    mask = keep & fitted.any() & (_heights(xyz, here - [0.0, 0.0, 0.0, params.distance_m]) <= 0.0)
    return Ground(mask, planes, edges, fitted)


def _edges(x: F32, params: GroundParams) -> F64:
    """Bounds of the segments along x: equal numbers of points, at multiples of the bin."""
    bins = int(np.ceil(2.0 * params.fit_range_m / ground_kernels.X_BIN_M))
    sample = ((x[:: ground_kernels.EDGE_SAMPLE] + params.fit_range_m) / ground_kernels.X_BIN_M).astype(int)
    before = np.concatenate([[0], np.cumsum(np.bincount(sample, minlength=bins + 1))])[:-1]
    wanted = np.arange(1, params.segments) * len(sample)
    inner = np.searchsorted(before * params.segments, wanted, side="left") * ground_kernels.X_BIN_M - params.fit_range_m
    return np.concatenate([[-params.fit_range_m], inner, [params.fit_range_m]])


def _fit(parts: list[F32], edges: F64, params: GroundParams) -> tuple[F64, Mask]:
    """Fit the planes, from the flattest segment outwards."""
    alone = [_refine(part, np.array([0.0, 0.0, 1.0, 0.0]), params) for part in parts]
    planes = np.array([plane for plane, _ in alone])
    raggedness = np.array([ragged for _, ragged in alone])
    fitted = np.isfinite(raggedness)
    if not fitted.any():
        return np.full_like(planes, np.nan), fitted
    root = int(np.argmin(raggedness))
    placed: set[int] = set()
    for s in np.argsort(raggedness, kind="stable").tolist():
        if fitted[s] and _meets_placed(s, planes[s], planes, edges, placed, params):
            placed.add(s)
    for s in [*range(root + 1, params.segments), *range(root - 1, -1, -1)]:
        if s in placed:
            continue
        nearer = s - 1 if s > root else s + 1
        placed.add(nearer)
        if not (fitted[s] and _meets_placed(s, planes[s], planes, edges, placed, params)):
            plane, ragged = _refine(parts[s], planes[nearer], params)
            fitted[s] = np.isfinite(ragged) and _meets_placed(s, plane, planes, edges, placed, params)
            planes[s] = plane if fitted[s] else planes[nearer]
    return planes, fitted


def _meets_placed(s: int, plane: F64, planes: F64, edges: F64, placed: set[int], params: GroundParams) -> bool:
    behind = max((each for each in placed if each < s), default=None)
    ahead = min((each for each in placed if each > s), default=None)
    return (behind is None or _meets(plane, planes[behind], (edges[behind + 1] + edges[s]) / 2, params)) and (
        ahead is None or _meets(plane, planes[ahead], (edges[s + 1] + edges[ahead]) / 2, params)
    )


def _meets(plane: F64, neighbour: F64, x: float, params: GroundParams) -> bool:
    step = (plane[3] + plane[0] * x) / plane[2] - (neighbour[3] + neighbour[0] * x) / neighbour[2]
    return bool(abs(step) <= params.distance_m and plane[:3] @ neighbour[:3] >= ground_kernels.MIN_COS_BEND)


def _refine(part: F32, prior: F64, params: GroundParams) -> tuple[F64, float]:
    """One segment's plane and its residual, which is infinite if the plane cannot be the road."""
    wanted = max(1, min(params.lowest_points, len(part) // plane_kernels.LOWEST_SHARE))
    raised = _heights(part, prior - [0.0, 0.0, 0.0, plane_kernels.HEIGHT_LOW_M]) * np.float32(plane_kernels.BINS_PER_M)
    levels = np.clip(raised.astype(int), 0, plane_kernels.HEIGHT_BINS - 1)
    centimetres = np.partition(levels, wanted - 1)[:wanted] if len(part) else levels
    mean_m = (centimetres.mean() + 0.5) / plane_kernels.BINS_PER_M + plane_kernels.HEIGHT_LOW_M if len(part) else 0.0
    plane, across, seen = prior, 0.0, 0
    low, high = mean_m - params.seed_height_m, mean_m + params.seed_height_m
    for k in range(1, params.iterations + 1):
        height = _heights(part, plane)
        seeds = part[(height >= np.float32(low)) & (height <= np.float32(high))].astype(np.float64)
        if len(seeds) < max(plane_kernels.MIN_SEEDS, plane_kernels.MIN_SHARE * len(part)):
            return plane, np.inf
        center = seeds.mean(axis=0)
        vectors, values, _ = np.linalg.svd(np.cov((seeds - center).T, bias=True))
        normal = vectors[:, 2] * (1.0 if vectors[2, 2] > 0.0 else -1.0)
        if values[1] < plane_kernels.MIN_SPREAD_M**2 or normal[2] < np.cos(np.radians(params.max_slope_deg)):
            return plane, np.inf
        plane = np.append(normal, -normal @ center)
        across, seen = float(values[2]), len(seeds)
        left = max(params.iterations - 1 - k, 0) / max(params.iterations - 1, 1)
        high = params.distance_m + max(params.seed_height_m - params.distance_m, 0.0) * left
        low = -high
    depth = -_heights(part, plane)
    below = np.minimum(depth[depth > params.distance_m], max(params.seed_height_m, params.distance_m))
    off = np.sqrt((across * seen + float((below**2).sum())) / (seen + len(below)))
    return plane, float(off) * len(part) / seen


def _heights(xyz: F32, planes: F64) -> F32:
    """Heights in single precision above one plane (4,), or above one plane per point (N, 4)."""
    a, b, c, d = planes.astype(np.float32).T
    return np.asarray(a * xyz[:, 0] + b * xyz[:, 1] + c * xyz[:, 2] + d)
