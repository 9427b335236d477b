"""Lines on the ground that consist of arcs without kinks, for roads and trajectories across them.

A position relative to a line is (s, d): metres along it, metres to its left. World: x, y metres, heading
counter-clockwise from x. Beyond its ends, a line continues as its first and last arc.
"""

from __future__ import annotations

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
        self._poses = np.array(poses)
        self._outer = np.concatenate([[-_LONG_M], self._starts[1:], [float(lengths.sum()) + _LONG_M]])

    @property
    def straight(self) -> bool:
        return not np.any(self._curvature)

    def to_world(self, s_m: npt.ArrayLike, d_m: npt.ArrayLike) -> F64:
        """(N, 3) x, y, heading of positions (s, d), each (N,) or a number."""
        s, d = np.broadcast_arrays(np.atleast_1d(np.asarray(s_m, dtype=np.float64)), np.asarray(d_m, dtype=np.float64))
        index = np.clip(np.searchsorted(self._starts, s, side="right") - 1, 0, len(self._starts) - 1)
        x0, y0, heading0 = self._poses[index].T
        along, sideways, turned = _arc(s - self._starts[index], self._curvature[index])
        x = x0 + along * np.cos(heading0) - sideways * np.sin(heading0)
        y = y0 + along * np.sin(heading0) + sideways * np.cos(heading0)
        heading = heading0 + turned
        return np.column_stack([x - d * np.sin(heading), y + d * np.cos(heading), heading])

    def advance(self, s_m: float, way_m: float, d_m: float) -> float:
        """The s reached from ``s_m`` by driving ``way_m`` (negative: against the line) at constant d: in a bend the
        inner way is shorter."""
        shares = 1.0 - self._curvature * d_m
        ways = np.concatenate([[0.0], np.cumsum(np.diff(self._outer) * shares)])
        return float(np.interp(np.interp(s_m, self._outer, ways) + way_m, ways, self._outer))

    def driven_m(self, from_m: float, to_m: float, d_m: float) -> float:
        """The way from one s to another at constant d, negative against the line: the inverse of ``advance``."""
        shares = 1.0 - self._curvature * d_m
        ways = np.concatenate([[0.0], np.cumsum(np.diff(self._outer) * shares)])
        start, end = np.interp([from_m, to_m], self._outer, ways)
        return float(end - start)


def _arc(length_m: F64, curvature_per_m: F64) -> tuple[F64, F64, F64]:
    """Metres ahead, metres to the left and the rotation after a distance along arcs: sin θ/κ and (1 − cos θ)/κ, θ =
    κ·s.

    Uses sinc to avoid a division by zero on a straight.
    """
    turned = curvature_per_m * length_m
    along = length_m * np.sinc(turned / np.pi)
    sideways = length_m * np.sin(turned / 2) * np.sinc(turned / (2 * np.pi))
    return along, sideways, turned
