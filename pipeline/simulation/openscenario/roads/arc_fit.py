"""A smooth curve as arcs: pairs of arcs (biarcs) that meet its points and headings exactly, as long as the curve stays
within a tolerance of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.simulation.world.lines import RoadLine
from pipeline.types import F64

TOLERANCE_M, TOLERANCE_RAD = 0.01, 0.003
"""Maximum distance and angle between a curve and its arcs, where it was sampled."""
_SHORTEST_M = 1e-6


@dataclass(frozen=True)
class FittedArcs:
    """Arcs along a curve."""

    arcs: list[tuple[float, float]]
    """Length and curvature of each, in order."""
    samples: list[int]
    """Numbers of the samples that the arcs meet."""
    at_m: list[float]
    """Distance along the arcs at each of these."""


def fit_arcs(poses: F64) -> FittedArcs:
    """Arcs through samples of a curve, (N, 3) x, y, heading; N ≥ 2. A stretch that leaves the tolerance is halved until
    two neighbouring samples are left."""
    arcs: list[tuple[float, float]] = []
    samples, at_m = [0], [0.0]
    waiting = [(0, len(poses) - 1)]
    while waiting:
        first, last = waiting.pop()
        pair = _biarc(poses[first], poses[last])
        if last - first > 1 and not (pair and _fits(pair, poses[first : last + 1])):
            middle = (first + last) // 2
            waiting += [(middle, last), (first, middle)]
            continue
        arcs += pair
        samples.append(last)
        at_m.append(at_m[-1] + sum(length for length, _ in pair))
    return FittedArcs(arcs, samples, at_m)


def _fits(arcs: list[tuple[float, float]], poses: F64) -> bool:
    """Whether the samples between the ends lie on the arcs. Samples are compared at the distance that their share of
    the chords suggests, along the normal there."""
    chords = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))])
    length = sum(each for each, _ in arcs)
    line = RoadLine(arcs, (float(poses[0, 0]), float(poses[0, 1]), float(poses[0, 2])))
    there = line.to_world(chords * (length / chords[-1]), 0.0)
    away = poses - there
    across = away[:, 1] * np.cos(there[:, 2]) - away[:, 0] * np.sin(there[:, 2])
    turned = np.abs(np.remainder(away[:, 2] + np.pi, 2 * np.pi) - np.pi)
    return bool(np.abs(across).max() <= TOLERANCE_M and turned.max() <= TOLERANCE_RAD)


def _biarc(start: F64, end: F64) -> list[tuple[float, float]]:
    """One or two arcs from a pose to another; none if they coincide. Both have the same tangent length d, from
    |v|² = 2 d v·(t₀ + t₁) + 2 d² (1 − t₀·t₁)."""
    v = end[:2] - start[:2]
    if float(np.hypot(*v)) < _SHORTEST_M:
        return []
    t0, t1 = (np.array([np.cos(pose[2]), np.sin(pose[2])]) for pose in (start, end))
    along, bent, square = float(v @ (t0 + t1)), 2.0 * (1.0 - float(t0 @ t1)), float(v @ v)
    # the positive root, in the form that stays exact as the tangents become parallel
    d = square / (along + float(np.sqrt(along * along + bent * square)))
    joint = (start[:2] + end[:2] + d * (t0 - t1)) / 2.0
    first, second = joint - start[:2], end[:2] - joint
    arcs = [_arc(first, t0), _arc(second, t1, from_end=True)]
    if abs(arcs[0][1] - arcs[1][1]) < 1e-12:
        return [(arcs[0][0] + arcs[1][0], arcs[0][1])]
    return arcs


def _arc(chord: F64, tangent: F64, from_end: bool = False) -> tuple[float, float]:
    """Length and curvature of the arc over a chord with a tangent at its beginning, or at its end."""
    across = float(tangent[0] * chord[1] - tangent[1] * chord[0]) * (-1.0 if from_end else 1.0)
    half, size = float(np.arctan2(across, float(tangent @ chord))), float(np.hypot(*chord))
    return size / float(np.sinc(half / np.pi)), 2.0 * float(np.sin(half)) / size
