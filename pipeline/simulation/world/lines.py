"""Lines on the ground that consist of arcs without kinks, for roads and trajectories across them.

A position relative to a line is (s, d): metres along it, metres to its left. World: x, y metres, heading
counter-clockwise from x. Beyond its ends, a line continues as its first and last arc.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pipeline.types import F64

WorldPose = tuple[float, float, float]
_LONG_M = 1e5


class RoadLine:
    """arcs: (length in metres, curvature per metre, positive to the left) of each; start: x, y, heading."""

    def __init__(self, arcs: Sequence[tuple[float, float]], start: WorldPose = (0.0, 0.0, 0.0)) -> None:
        self._curvature = np.array([curvature for _, curvature in arcs])
        lengths = np.array([length for length, _ in arcs])
        self._starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        poses = [start]
        for i in range(len(arcs) - 1):
            x, y, heading = poses[-1]
            (along,), (sideways,), (turned,) = _arc(lengths[i : i + 1], self._curvature[i : i + 1])
            c, s = np.cos(heading), np.sin(heading)
            poses.append((x + along * c - sideways * s, y + along * s + sideways * c, heading + turned))
        self._x, self._y, self._heading = np.array(poses).T.copy()
        self._c, self._s = np.cos(self._heading), np.sin(self._heading)
        columns = self._starts, self._curvature, self._x, self._y, self._heading, self._c, self._s
        self._arcs: list[tuple[float, ...]] = np.column_stack(columns).tolist()
        self._arc_starts: list[float] = self._starts.tolist()
        self.straight = not np.any(self._curvature)
        """Whether it does not bend."""
        self._outer = [-_LONG_M, *self._arc_starts[1:], float(lengths.sum()) + _LONG_M]
        self._ways: tuple[float, list[float]] | None = None  # the last d, at which most drives stay, and its ways

    def to_world(self, s_m: npt.ArrayLike, d_m: npt.ArrayLike) -> F64:
        """(N, 3) x, y, heading of positions (s, d), each (N,) or a number."""
        if isinstance(s_m, float) and isinstance(d_m, float):
            return np.array([self._pose(s_m, d_m)])
        s, d = np.asarray(s_m, dtype=np.float64), np.asarray(d_m, dtype=np.float64)
        if s.ndim == 0:  # written out, as broadcasting takes as long as the rest
            s = np.full(d.shape or (1,), s)
        index = np.maximum(np.searchsorted(self._starts, s, side="right") - 1, 0)
        length = s - self._starts[index]
        along, sideways, turned = (length, 0.0, 0.0) if self.straight else _arc(length, self._curvature[index])
        c0, s0 = self._c[index], self._s[index]
        found = np.empty((len(s), 3))
        found[:, 2] = heading = self._heading[index] + turned
        found[:, 0] = self._x[index] + along * c0 - sideways * s0 - d * np.sin(heading)
        found[:, 1] = self._y[index] + along * s0 + sideways * c0 + d * np.cos(heading)
        return found

    def _pose(self, s_m: float, d_m: float) -> WorldPose:
        """``to_world`` of one position, to the last bit: with arrays, a number takes ten times as long."""
        start, curvature, x, y, heading, c, s = self._arcs[max(bisect_right(self._arc_starts, s_m) - 1, 0)]
        along, sideways = float(s_m) - start, 0.0
        if not self.straight:
            length, turned = along, curvature * along
            along = length * _sinc(turned / np.pi)
            sideways = length * float(np.sin(turned / 2)) * _sinc(turned / (2 * np.pi))
            heading += turned
        return (
            x + along * c - sideways * s - d_m * float(np.sin(heading)),
            y + along * s + sideways * c + d_m * float(np.cos(heading)),
            heading,
        )

    def advance(self, s_m: float, way_m: float, d_m: float) -> float:
        """The s reached from ``s_m`` by driving ``way_m`` (negative: against the line) at constant d: in a bend the
        inner way is shorter."""
        ways = self._ways_at(d_m)
        return _interpolated(_interpolated(s_m, self._outer, ways) + way_m, ways, self._outer)

    def driven_m(self, from_m: float, to_m: float, d_m: float) -> float:
        """The way from one s to another at constant d, negative against the line: the inverse of ``advance``."""
        ways = self._ways_at(d_m)
        return _interpolated(to_m, self._outer, ways) - _interpolated(from_m, self._outer, ways)

    def _ways_at(self, d_m: float) -> list[float]:
        """(A + 1,) the ways at constant d from the beginning to the ends of the arcs."""
        last = self._ways
        if last is None or last[0] != d_m:
            shares = 1.0 - self._curvature * d_m
            last = self._ways = d_m, [0.0, *np.cumsum(np.diff(self._outer) * shares).tolist()]
        return last[1]


def _arc(length_m: F64, curvature_per_m: F64) -> tuple[F64, F64, F64]:
    """Metres ahead, metres to the left and the rotation after a distance along arcs: sin θ/κ and (1 − cos θ)/κ, θ =
    κ·s.

    Uses sinc to avoid a division by zero on a straight.
    """
    turned = curvature_per_m * length_m
    along = length_m * np.sinc(turned / np.pi)
    sideways = length_m * np.sin(turned / 2) * np.sinc(turned / (2 * np.pi))
    return along, sideways, turned


def _sinc(x: float) -> float:
    """``np.sinc`` of one number."""
    y = np.pi * x
    return float(np.sin(y)) / y if y else 1.0


def _interpolated(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """``np.interp`` of one number, to the last bit."""
    at = bisect_right(xs, x) - 1
    if at < 0 or at + 1 >= len(xs):
        return ys[max(at, 0)]
    return (ys[at + 1] - ys[at]) / (xs[at + 1] - xs[at]) * (x - xs[at]) + ys[at]
