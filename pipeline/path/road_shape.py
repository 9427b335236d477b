"""The shape of a road from the objects beside it, as a line with a sigma at each distance.

Kerbs, hedges, walls, rails and rows of parked cars are parallel to the road, each at its own distance. Of all possible
road shapes, the true one therefore places the cells beside it at the fewest distances: the log-likelihood of their
distances under their own histogram is highest (least entropy). The cells need not be classified as left or right, kerb
or car, and gaps in a row do no harm. Weighted with a prior of curvature, all shapes together give the mean and its
sigma at each distance; with little beside the road, the sigma is the prior's.

The line keeps the current distance of the car from the edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pipeline.common.geometry import F64
from pipeline.params import PathParams
from pipeline.path.corridor import nearest
from pipeline.path.estimates import arc, samples
from pipeline.path.ground_points import now_at
from pipeline.path.shape_kernels import moments, weigh_shapes
from pipeline.types import EgoState

_NODES_M = (20.0, 40.0)
"""A shape is a cubic, given by its lateral offset at these two distances and its heading at the car."""
_TEMPER = 0.2
"""Weight of each cell's log-likelihood: cells of one car or one hedge are not independent, so five count as one. In
simulated traffic, 0.1 gives errors that fit the sigma better, but it doubles the median error at 30 m in the bends of
the streets suite (0.31 to 0.63 m), because the prior then straightens them."""
_BAND_M = 12.0
"""Cells farther from the line than this share one bin on each side: house fronts and side streets no longer follow the
road."""
_IMPROBABLE = 12.0
"""A shape is not evaluated if its log prior is this much below the largest one: the cells rarely make up for a factor
of 160,000. This only saves time."""
_CHANCE = 1.0
"""Number of cells that a lateral bin holds by chance, as a multiple of the mean over all bins."""
_EDGE_M, _EDGE_CELLS, _EDGE_SHARE = 0.5, 5, 0.3
"""An edge is a strip beside the road of this width with at least this many cells and this share of the fullest strip's
cells."""
_CLEAR_M = 0.9
"""Half a car's width: cells nearer to the line than this block it."""
_CHANGES_OVER_M, _MOST_CHANGE_PER_M = (3.0, 10.0, 30.0), (0.01, 0.025, 0.1)
"""How much the curvature of the road may differ from that of the way just driven, for the next 6 m, the next 20 m and
the 20 m beyond (1 σ): the change that ``path.lateral_jerk_mps3`` allows up to these distances, the middle of each
section, but at most these curvatures in 1/m. The last is a street corner with a radius of 10 m."""
_MODEL_SIGMA_PER_M2 = 0.0004
"""Standard deviation of the lateral offset per squared distance, since a street is not exactly a cubic: 0.16 m at 20 m,
0.64 m at 40 m. In 840 frames of simulated streets, 70 to 88 % of the errors at 30 to 40 m lie within one sigma."""


class Grid(NamedTuple):
    """The shapes to try: lateral offset at the two nodes (m) and the heading (rad), each from −max to max."""

    first_m: tuple[float, float]
    """At the near node: maximum, step."""
    second_m: tuple[float, float]
    """At the far node: maximum, step."""
    heading: tuple[float, float]
    """Maximum, step."""
    bin_m: float
    """Width of the lateral bins for the votes of the points."""


# From coarse to fine: a search from scratch, around an earlier shape or the result of that search, and around the best
_WIDE = Grid((8.0, 1.0), (24.0, 2.0), (0.0, 1.0), 1.5)
_USUAL = Grid((4.0, 0.5), (15.0, 1.25), (0.02, 0.02), 1.0)
_FINE = Grid((1.5, 0.25), (4.5, 0.5), (0.02, 0.02), 0.5)
_MOST_CELLS, _MOST_FINE = 150, 200
"""Most cells used by the two coarser grids and by the finest one, to limit the computing time. A sweep of 16 rings
gives 100 to 300 cells."""


class Prior(NamedTuple):
    """Prior over road shapes, before structure beside the road is considered."""

    bend_sigma: float
    """Standard deviation of the curvature over 20 m, 1/m."""
    heading_sigma: float
    """Standard deviation of the road's heading relative to the car, rad."""
    own: float
    """Curvature of the way just driven, 1/m."""
    own_sigma: float
    """Standard deviation of the road's curvature over the next 6 m from ``own``."""
    later_sigma: float
    """The same for the next 20 m."""
    far_sigma: float
    """The same for the 20 m beyond."""


class Starts(NamedTuple):
    """Lines relative to which shapes are searched, (K, 2) each; at least one is set."""

    own: F64 | None
    """The arc of own motion: any road starts along it. None: no search from scratch in this frame."""
    before: F64 | None
    """The previous frame's shape, predicted to now; None without one."""


def begin(before: F64 | None, ego: EgoState, dt_s: float | None, anew: bool, params: PathParams) -> Starts:
    """The lines to search around. anew: also search from scratch."""
    s = samples(params.length_m)
    moved = moved_on(before, ego, dt_s, s) if before is not None and dt_s else None
    if moved is not None and not anew:
        return Starts(None, moved)
    turning = ego.speed_mps > params.min_speed_mps
    return Starts(arc((ego.yaw_rate_radps or 0.0) / ego.speed_mps if turning else 0.0, s)[0], moved)


def moved_on(shape: F64, ego: EgoState, dt_s: float, s: F64) -> F64:
    """The previous frame's shape, starting at the car and parallel to itself."""
    line = _resampled(now_at(shape, ego, dt_s), s)
    turned = np.arctan2(line[1, 1], line[1, 0])  # a road whose direction differs from the car's is not the car's road
    turned = turned - np.clip(turned, -0.02, 0.02)
    c, sn = np.cos(turned), np.sin(turned)
    return np.column_stack([line[:, 0] * c + line[:, 1] * sn, line[:, 1] * c - line[:, 0] * sn])


def _resampled(line: F64, s: F64) -> F64:
    """The line sampled at ``s`` from beside the origin on, shifted to start at the origin; straight beyond its end."""
    _, along = nearest(line, np.zeros((1, 2)))
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = s + max(float(along[0]), 0.0)
    out = np.column_stack([np.interp(at, lengths, line[:, k]) for k in (0, 1)])
    over = np.maximum(at - lengths[-1], 0.0)
    way = line[-1] - line[-3]
    out = out + over[:, None] * way / max(np.hypot(*way), 1e-9)
    return out - out[0]


def fitted(xy: F64, blocks: F64, starts: Starts, ego: EgoState, params: PathParams) -> tuple[F64, F64]:
    """(K, 2) the most probable shape and (K,) its sigma.

    Args:
        xy: (M, 2) cells.
        blocks: (M,) log-likelihood of each cell that no road leads through it.
        starts: lines relative to which shapes are searched.
        ego: own motion.
        params: of the path.
    """
    s = samples(params.length_m)
    speed2 = max(ego.speed_mps, params.min_speed_mps, 0.1) ** 2
    curvature_sigma = min(params.lateral_accel_mps2 / speed2, 0.02)
    speed = max(ego.speed_mps, params.min_speed_mps)
    heading_sigma = max(params.lane_keeping_sigma_mps / speed, 0.01)
    own = (ego.yaw_rate_radps or 0.0) / speed if ego.speed_mps > params.min_speed_mps else 0.0
    noise = 2.0 * params.yaw_rate_sigma_radps / speed
    jerk = params.lateral_jerk_mps3 / speed**3
    changes = (
        float(np.hypot(noise, min(jerk * over_m, most)))
        for over_m, most in zip(_CHANGES_OVER_M, _MOST_CHANGE_PER_M, strict=True)
    )
    against_own = tuple(changes) if ego.yaw_rate_radps is not None else (1.0, 1.0, 1.0)
    prior = Prior(curvature_sigma, heading_sigma, own, *against_own)
    begun = [starts.before] if starts.before is not None else []
    if starts.own is not None:
        begun.append(_round(starts.own, xy, blocks, _WIDE, prior, s)[0])
    found = [_round(line, xy, blocks, _USUAL, prior, s) for line in begun]
    best = max(found, key=lambda each: each[2])
    line, sigma, _ = _round(best[0], xy, blocks, _FINE, prior, s)
    return line, np.sqrt(sigma**2 + params.lane_keeping_sigma_m**2 + (_MODEL_SIGMA_PER_M2 * s * s) ** 2)


def room(line: F64, xy: F64, usual_m: float) -> tuple[float, float]:
    """Free width of the corridor to the left and to the right of the line: half way between the car's side and an edge
    if one is near, because the space beyond rather belongs to the edge; else the usual width."""
    aside, along = nearest(line, xy)
    near = aside[(along > 0.0) & (along < _NODES_M[1])]
    left, right = (_nearest_edge_m(side[side > _CLEAR_M]) for side in (near, -near))
    return min(usual_m, 0.5 * (_CLEAR_M + left)), min(usual_m, 0.5 * (_CLEAR_M + right))


def _nearest_edge_m(aside: F64) -> float:
    """Distance of the nearest edge with enough cells; infinite without one."""
    counts = np.bincount((aside / _EDGE_M).astype(np.intp), minlength=1)
    full = np.flatnonzero(counts >= max(_EDGE_CELLS, _EDGE_SHARE * counts.max()))
    return float(full[0]) * _EDGE_M if len(full) else np.inf


def _round(line: F64, xy: F64, blocks: F64, grid: Grid, prior: Prior, s: F64) -> tuple[F64, F64, float]:
    """The line shifted to the most probable shape around it, (K,) its sigma, and the log-evidence."""
    aside, along = nearest(line, xy)
    keep = np.flatnonzero((along > 0.0) & (along < _NODES_M[1] + 5.0) & (np.abs(aside) < 2.0 * _BAND_M))
    keep = keep[:: -(-len(keep) // (_MOST_FINE if grid is _FINE else _MOST_CELLS)) or 1]
    heading, bends = _bends(line)
    first, second, turns = (_steps(*each) for each in (grid.first_m, grid.second_m, grid.heading))
    weights, evidence = weigh_shapes(
        along[keep], aside[keep], blocks[keep], first, second, turns, grid.bin_m, _BAND_M, _TEMPER,
        heading, bends, *prior, _CHANCE, _CLEAR_M, _IMPROBABLE,
    )  # fmt: skip
    mean, sigma = moments(s, first, second, turns, weights, _NODES_M[1])
    return _shifted(line, mean, s), sigma, evidence


def _steps(most: float, step: float) -> F64:
    count = round(most / step)
    return np.asarray(np.arange(-count, count + 1) * step, np.float64)


def _bends(line: F64) -> tuple[float, F64]:
    """Heading at the car, and (3,) mean curvature from 0 to 6 m, 0 to 20 m and 20 to 40 m."""
    way = np.diff(line, axis=0)
    heading = np.unwrap(np.arctan2(way[:, 1], way[:, 0]))
    from_to = ((0, 6), (0, 19), (20, 39))
    return float(heading[0]), np.array([(heading[b] - heading[a]) / (b - a) for a, b in from_to])


def _shifted(line: F64, aside: F64, s: F64) -> F64:
    """The line moved along its normals by (K,) metres."""
    way = np.gradient(line, axis=0)
    normal = np.column_stack([-way[:, 1], way[:, 0]]) / np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return _resampled(line + aside[:, None] * normal, s)
