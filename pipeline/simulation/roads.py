"""Roads: a reference line of straights and arcs, with lanes beside it, named as ASAM OpenDRIVE names them.

The reference line runs in the middle of the median. Lanes −1, −2, … lie to its right and run along it, −1 the
innermost; +1, +2, … lie to its left and run against it. A place on the road is (s, d): metres along the reference
line, metres to its left. World: x, y metres, heading counter-clockwise from x; the road is flat.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field

from pipeline.types import F64


class Strict(BaseModel):
    """A part of a scenario file: unknown keys and infinite numbers are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Segment(Strict):
    """A stretch of one curvature, positive to the left; 0 is straight."""

    length_m: float = Field(gt=0.0, le=100_000.0)
    curvature_per_m: float = Field(0.0, ge=-0.2, le=0.2)


class Road(Strict):
    segments: tuple[Segment, ...] = Field(min_length=1)
    lane_width_m: float = Field(3.6, ge=2.0, le=6.0)
    lanes_forward: int = Field(3, ge=1, le=6)
    lanes_oncoming: int = Field(2, ge=0, le=6)
    median_m: float = Field(4.0, ge=0.0, le=30.0)
    shoulder_m: float = Field(2.5, ge=0.0, le=10.0)

    def lane_offset_m(self, lane: int) -> float:
        """d of a lane's middle. ValueError for a lane that the road does not have."""
        if lane == 0 or not -self.lanes_forward <= lane <= self.lanes_oncoming:
            raise ValueError(f"no lane {lane}: there are −{self.lanes_forward}…−1 and 1…{self.lanes_oncoming}")
        side = 1.0 if lane > 0 else -1.0
        return side * (self.median_m / 2 + (abs(lane) - 0.5) * self.lane_width_m)

    def edges_m(self) -> tuple[tuple[float, float], ...]:
        """d of the (right, left) edges of each carriageway, without shoulders: forward first."""
        inner = self.median_m / 2
        forward = (-inner - self.lanes_forward * self.lane_width_m, -inner)
        oncoming = (inner, inner + self.lanes_oncoming * self.lane_width_m)
        return (forward, oncoming) if self.lanes_oncoming else (forward,)

    def curvature_per_m(self, s_m: float) -> float:
        """Curvature of the reference line at s; the first and last segment go on for ever."""
        ends = np.cumsum([segment.length_m for segment in self.segments])
        return self.segments[min(int(np.searchsorted(ends, s_m, side="right")), len(ends) - 1)].curvature_per_m

    def to_world(self, s_m: npt.ArrayLike, d_m: npt.ArrayLike) -> F64:
        """(N, 3) x, y, heading of places (s, d), each (N,) or a number."""
        s, d = np.broadcast_arrays(np.atleast_1d(np.asarray(s_m, dtype=np.float64)), np.asarray(d_m, dtype=np.float64))
        starts, poses = self._segment_starts
        index = np.clip(np.searchsorted(starts, s, side="right") - 1, 0, len(starts) - 1)
        curvature = np.array([segment.curvature_per_m for segment in self.segments])[index]
        x0, y0, heading0 = poses[index].T
        along, sideways, turned = _arc(s - starts[index], curvature)
        x = x0 + along * np.cos(heading0) - sideways * np.sin(heading0)
        y = y0 + along * np.sin(heading0) + sideways * np.cos(heading0)
        heading = heading0 + turned
        return np.column_stack([x - d * np.sin(heading), y + d * np.cos(heading), heading])

    @cached_property
    def _segment_starts(self) -> tuple[F64, F64]:
        """s of each segment's start, and its (x, y, heading)."""
        starts, poses = [0.0], [(0.0, 0.0, 0.0)]
        for segment in self.segments[:-1]:
            x, y, heading = poses[-1]
            (along,), (sideways,), (turned,) = _arc(np.array([segment.length_m]), np.array([segment.curvature_per_m]))
            c, s = np.cos(heading), np.sin(heading)
            poses.append((x + along * c - sideways * s, y + along * s + sideways * c, heading + turned))
            starts.append(starts[-1] + segment.length_m)
        return np.array(starts), np.array(poses)


def _arc(length_m: F64, curvature_per_m: F64) -> tuple[F64, F64, F64]:
    """Metres ahead, metres to the left and the turn after a way along arcs: sin θ/κ and (1 − cos θ)/κ, θ = κ·s.

    Written with sinc, which has no division by zero on a straight."""
    turned = curvature_per_m * length_m
    along = length_m * np.sinc(turned / np.pi)
    sideways = length_m * np.sin(turned / 2) * np.sinc(turned / (2 * np.pi))
    return along, sideways, turned
