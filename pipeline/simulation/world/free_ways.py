"""Actors on a way of their own, independent of the road's lanes: a pedestrian who crosses, a car from a side road."""

from __future__ import annotations

from math import radians

from pydantic import Field

from pipeline.simulation.world.actors import RoadUser, Speeds
from pipeline.simulation.world.lines import RoadLine
from pipeline.simulation.world.roads import Road, ScenarioPart

_STRAIGHT_M = 1.0


class WayPiece(ScenarioPart):
    """A straight or an arc of a way."""

    length_m: float = Field(gt=0.0, le=100_000.0)
    """Along the way."""
    curvature_per_m: float = Field(default=0.0, ge=-100.0, le=100.0)
    """Positive to the left."""


class FreeActor(RoadUser, Speeds):
    """A road user on a way of its own, which begins at a place beside or on the road and never runs backwards."""

    s_m: float = Field(ge=-100_000.0, le=100_000.0)
    """Of its centre at time 0, along the road."""
    d_m: float = Field(ge=-10_000.0, le=10_000.0)
    """Of its centre at time 0, to the left of the reference line."""
    heading_deg: float = 0.0
    """Direction at time 0, to the left of the road's direction there: 90 crosses the road from right to left."""
    way: tuple[WayPiece, ...] = ()
    """Where it goes from there; beyond the last piece it continues as that one. Empty: straight on."""

    def line(self, road: Road) -> RoadLine:
        """The way of its centre in the world; s = 0 is where it starts."""
        x, y, heading = road.to_world(self.s_m, self.d_m)[0].tolist()
        arcs = [(piece.length_m, piece.curvature_per_m) for piece in self.way] or [(_STRAIGHT_M, 0.0)]
        return RoadLine(arcs, (x, y, heading + radians(self.heading_deg)))

    def curvature_per_m(self, travelled_m: float) -> float:
        """Of the way after a distance."""
        for piece in self.way:
            if travelled_m < piece.length_m:
                return piece.curvature_per_m
            travelled_m -= piece.length_m
        return self.way[-1].curvature_per_m if self.way else 0.0
