"""Roads: a reference line of straights, arcs and transitions, with lanes beside it, named as in ASAM OpenDRIVE.

The reference line runs in the middle of the median. Lanes −1, −2, … are to its right and run along it, −1 being the
innermost; +1, +2, … are to its left and run against it. A position on the road is (s, d): metres along the reference
line, metres to its left. World: x, y metres, heading counter-clockwise from x; the road is flat.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from functools import cached_property
from itertools import pairwise
from math import ceil
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from pipeline.simulation.world.lines import RoadLine
from pipeline.types import F64

_TRANSITION_STEP_M = 0.5
_CROSSING_REACH_M = 250.0


class ScenarioPart(BaseModel):
    """A part of a scenario file: unknown keys and infinite numbers are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A changed copy, validated again, without values cached from the original."""
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return type(self).model_validate({**fields, **(update or {})})


class Segment(ScenarioPart):
    """A section of road, straight by default; curvature is positive to the left. ``radius_m`` may be used instead of
    ``curvature_per_m``. With ``end_curvature_per_m`` the curvature changes linearly along the segment: a transition
    (clothoid) between a straight and a bend."""

    length_m: float = Field(gt=0.0, le=100_000.0)
    """Along the reference line."""
    curvature_per_m: float = Field(default=0.0, ge=-0.2, le=0.2)
    """At its beginning; positive to the left."""
    end_curvature_per_m: float | None = Field(default=None, ge=-0.2, le=0.2)
    """At its end; None keeps it constant."""

    @model_validator(mode="before")
    @classmethod
    def _radius(cls, given: Any) -> Any:
        if not isinstance(given, dict) or "radius_m" not in given:
            return given
        rest = {key: value for key, value in given.items() if key != "radius_m"}
        radius = given["radius_m"]
        if "curvature_per_m" in rest:
            raise ValueError("give radius_m or curvature_per_m, not both")
        if not isinstance(radius, int | float) or isinstance(radius, bool) or not abs(radius) >= 5.0:
            raise ValueError("radius_m must be a number of at least 5 (to the left) or at most −5 (to the right)")
        return {**rest, "curvature_per_m": 1.0 / radius}

    @model_validator(mode="after")
    def _short_transition(self) -> Segment:
        if self.end_curvature_per_m is not None and self.length_m > 2000.0:
            raise ValueError("a transition may be 2000 m long at most")
        return self

    def arcs(self) -> list[tuple[float, float]]:
        """(length, curvature) of the arcs that approximate it."""
        if self.end_curvature_per_m is None:
            return [(self.length_m, self.curvature_per_m)]
        return transition_arcs(self.length_m, self.curvature_per_m, self.end_curvature_per_m)


def transition_arcs(length_m: float, from_per_m: float, to_per_m: float) -> list[tuple[float, float]]:
    """(length, curvature) of the arcs that approximate a transition: at most half a metre each, with the curvature at
    its middle, so that headings at the joints are exact and positions accurate to about a millimetre."""
    count = ceil(length_m / _TRANSITION_STEP_M)
    shares = (np.arange(count) + 0.5) / count
    bends = from_per_m + shares * (to_per_m - from_per_m)
    return [(length_m / count, bend) for bend in bends.tolist()]


class Crossing(ScenarioPart):
    """Another road, straight and level, across this one."""

    s_m: float = Field(ge=0.0, le=100_000.0)
    """Intersection of the two centre lines."""
    angle_deg: float = Field(default=90.0, ge=40.0, le=140.0)
    """Rotation of its direction to the left of this road's direction there; 90 runs from right to left."""
    lanes_each_way: int = Field(default=1, ge=1, le=3)
    """Of the other road."""
    lane_width_m: float = Field(default=3.5, ge=2.5, le=5.0)
    """Of the other road."""

    def half_width_m(self) -> float:
        return self.lanes_each_way * self.lane_width_m


class Beacon(ScenarioPart):
    """An obstacle on the road, such as at roadworks."""

    s_m: float
    """Of its middle, along the road."""
    d_m: float
    """Of its middle, to the left of the reference line."""
    length_m: float = Field(default=0.1, ge=0.05, le=50.0)
    """Along the road."""
    width_m: float = Field(default=0.25, ge=0.05, le=5.0)
    """Across the road."""
    high_m: float = Field(default=1.05, ge=0.1, le=5.0)
    """Of its top above the road."""


class Strip(ScenarioPart):
    """A kerb with its pavement, a hedge or a wall along the road."""

    kind: Literal["kerb", "hedge", "wall"]
    """Defines its appearance."""
    d_m: float
    """Offset of its middle to the left of the reference line."""
    from_m: float = 0.0
    """Start along the road."""
    to_m: float = Field(default=100_000.0, gt=0.0)
    """End along the road."""
    width_m: float = Field(default=0.3, ge=0.05, le=10.0)
    """Across the road."""
    high_m: float = Field(default=1.2, ge=0.03, le=6.0)
    """Of its top above the road."""


class Road(ScenarioPart):
    """A road and its surroundings."""

    segments: tuple[Segment, ...] = Field(min_length=1)
    """One after another from s = 0."""
    crossings: tuple[Crossing, ...] = ()
    """Other roads across this one."""
    lane_width_m: float = Field(default=3.6, ge=2.0, le=30.0)
    """Of every lane; proving grounds have lanes as wide as an airfield."""
    lanes_forward: int = Field(default=3, ge=1, le=6)
    """Lanes of the ego vehicle's direction."""
    lanes_oncoming: int = Field(default=2, ge=0, le=6)
    """Lanes of the other direction."""
    median_m: float = Field(default=4.0, ge=0.0, le=30.0)
    """Between the directions, without lanes."""
    forward_edges_m: tuple[float, ...] = ()
    """d of the lines of the ego vehicle's lanes, from the middle of the road outwards, if lanes differ in width or the
    directions lie unequally far out; then the four keys above follow from them."""
    oncoming_edges_m: tuple[float, ...] = ()
    """The same for the other direction; only with ``forward_edges_m``."""
    shoulder_m: float = Field(default=2.5, ge=0.0, le=10.0)
    """Beside the outermost lanes."""
    painted: bool = True
    """Whether it has lane lines and edge lines."""
    crest_radius_m: float | None = Field(default=None, ge=300.0)
    """Minimum vertical radius of its crests and sags; None: it is level."""
    crests_every_m: float = Field(default=400.0, ge=50.0)
    """Distance from crest to crest."""
    humps_per_m: tuple[tuple[float, float], ...] = ()
    """(s, vertical curvature) in ascending order, linear in between, instead of ``crest_radius_m``."""
    beacons: tuple[Beacon, ...] = ()
    """Obstacles on the road."""
    strips: tuple[Strip, ...] = ()
    """Structures along the road."""

    @model_validator(mode="before")
    @classmethod
    def _from_edges(cls, given: Any) -> Any:
        """The keys that follow from the edges of lanes."""
        forward, oncoming = ([*_numbers(given, f"{name}_edges_m")] for name in ("forward", "oncoming"))
        if not forward:
            if oncoming:
                raise ValueError("oncoming_edges_m needs forward_edges_m")
            return given
        if len(forward) == 1 or len(oncoming) == 1:
            raise ValueError("a lane has two edges; give more than one, or none")
        if any(b >= a for a, b in pairwise(forward)) or any(b <= a for a, b in pairwise(oncoming)):
            raise ValueError("the edges of lanes must lead outwards: forward_edges_m falls, oncoming_edges_m rises")
        if oncoming and oncoming[0] < forward[0]:
            raise ValueError("the directions overlap: oncoming_edges_m must begin to the left of forward_edges_m")
        return {
            **given,
            "lanes_forward": len(forward) - 1,
            "lanes_oncoming": max(len(oncoming) - 1, 0),
            "lane_width_m": (forward[0] - forward[-1]) / (len(forward) - 1),
            "median_m": min(oncoming[0] - forward[0], 30.0) if oncoming else 0.0,
        }

    @model_validator(mode="after")
    def _wide_enough_bends(self) -> Road:
        """A lane inside a bend whose radius is smaller than the lane's offset would run backwards."""
        widest = max(abs(edge) for pair in self.edges_m() for edge in pair)
        for segment in self.segments:
            for bend in (segment.curvature_per_m, segment.end_curvature_per_m or 0.0):
                if abs(bend) * widest > 0.9:
                    raise ValueError(
                        f"a bend of {1 / abs(bend):.3g} m radius is too tight for a road {2 * widest:.3g} m wide"
                    )
        return self

    def lane_offset_m(self, lane: int) -> float:
        """d of a lane's middle. ValueError for a lane that the road does not have."""
        if lane == 0 or not -self.lanes_forward <= lane <= self.lanes_oncoming:
            raise ValueError(f"no lane {lane}: there are −{self.lanes_forward}…−1 and 1…{self.lanes_oncoming}")
        if self.forward_edges_m:
            edges = self.lane_lines_m()[0 if lane < 0 else 1]
            return (edges[abs(lane) - 1] + edges[abs(lane)]) / 2
        side = 1.0 if lane > 0 else -1.0
        return side * (self.median_m / 2 + (abs(lane) - 0.5) * self.lane_width_m)

    def hump_per_m(self, s_m: float) -> float:
        """Vertical curvature at s, positive on a crest. Crests and sags alternate."""
        if self.humps_per_m:
            at_m, curvature = zip(*self.humps_per_m, strict=True)
            return float(np.interp(s_m, at_m, curvature))
        if self.crest_radius_m is None:
            return 0.0
        return float(np.sin(2.0 * np.pi * s_m / self.crests_every_m)) / self.crest_radius_m

    def lane_lines_m(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """d of every edge of a lane from the middle of the road outwards: forward, and oncoming (empty if none)."""
        return self._lane_lines

    @cached_property
    def _lane_lines(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        if self.forward_edges_m:
            return self.forward_edges_m, self.oncoming_edges_m
        inner = self.median_m / 2
        forward = tuple(-inner - i * self.lane_width_m for i in range(self.lanes_forward + 1))
        oncoming = tuple(inner + i * self.lane_width_m for i in range(self.lanes_oncoming + 1))
        return forward, oncoming if self.lanes_oncoming else ()

    def lanes(self) -> tuple[int, ...]:
        """The numbers of all lanes."""
        return (*range(-self.lanes_forward, 0), *range(1, self.lanes_oncoming + 1))

    def edges_m(self) -> tuple[tuple[float, float], ...]:
        """d of the (right, left) edges of each carriageway, without shoulders: forward first."""
        forward, oncoming = self.lane_lines_m()
        pairs = ((forward[-1], forward[0]), *([(oncoming[0], oncoming[-1])] if oncoming else []))
        return tuple(pairs)

    def curvature_per_m(self, s_m: float) -> float:
        """Curvature of the reference line at s; the first and last segment continue indefinitely."""
        ends = self.segment_ends_m
        index = min(bisect_right(ends, s_m), len(ends) - 1)
        segment = self.segments[index]
        if segment.end_curvature_per_m is None:
            return segment.curvature_per_m
        share = min(max(1.0 - (ends[index] - s_m) / segment.length_m, 0.0), 1.0)
        return segment.curvature_per_m + float(share) * (segment.end_curvature_per_m - segment.curvature_per_m)

    @cached_property
    def segment_ends_m(self) -> list[float]:
        """The s at which each segment ends."""
        ends_m: list[float] = np.cumsum([segment.length_m for segment in self.segments]).tolist()
        return ends_m

    def to_world(self, s_m: npt.ArrayLike, d_m: npt.ArrayLike) -> F64:
        """(N, 3) x, y, heading of positions (s, d), each (N,) or a number."""
        return self.line.to_world(s_m, d_m)

    @cached_property
    def line(self) -> RoadLine:
        """The reference line."""
        return RoadLine([arc for segment in self.segments for arc in segment.arcs()])

    @cached_property
    def crossing_lines(self) -> tuple[RoadLine, ...]:
        """The middle line of each crossing road; s = 0 is where it meets this road's."""
        lines = []
        for crossing in self.crossings:
            x, y, heading = self.to_world(crossing.s_m, 0.0)[0].tolist()
            lines.append(RoadLine([(_CROSSING_REACH_M, 0.0)], (x, y, heading + float(np.radians(crossing.angle_deg)))))
        return tuple(lines)


def _numbers(given: Any, key: str) -> list[float]:
    """A list of numbers among the given keys; empty if it is none, which its own validation reports."""
    found = given.get(key, ()) if isinstance(given, dict) else ()
    numbers = [each for each in found if isinstance(each, int | float)] if isinstance(found, list | tuple) else []
    return numbers if isinstance(found, list | tuple) and len(numbers) == len(found) else []
