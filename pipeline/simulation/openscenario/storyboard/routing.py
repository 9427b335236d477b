"""Routes and trajectories along the way of the ego vehicle."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.positions import place_at
from pipeline.simulation.openscenario.storyboard.running import Running, SpeedChange
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.xml_files import XmlElement, shown

_AWAY_M, _BESIDE_M = 2.0, 0.5
"""A trajectory that begins farther from the vehicle would make it jump."""
_STRAIGHT_M = 0.02
"""Less lateral movement between two vertices is none."""
_SHAPE_M = 0.5
"""Maximum lateral distance of the simulator's lane change from the vertices of a trajectory."""
_STEP_S = 1e-3
_MOST_VERTICES = 2_000


def check_route(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> None:
    """``AssignRouteAction`` or ``AcquirePositionAction``: nothing to do if it follows the way, which it decided if it
    is the ego vehicle's. OffTheWay otherwise."""
    waypoints = [
        each for each in at.below() if each.tag in ("Waypoint", "Position") and each.find("Position") is not None
    ]
    positions = [each.one("Position") for each in waypoints] or at.all("Position")
    if not positions:
        raise at.refusal(f"{at.tag} without positions is not supported; catalogs of routes are not read")
    for position in positions:
        if position.only().tag.startswith("Relative"):
            raise position.refusal(f"a route with a {position.only().tag} is not supported")
        place_at(position, scope, stage.road, stage.place_of)


@dataclass(frozen=True)
class _Vertex:
    t_s: float
    s_m: float
    d_m: float


def follow_trajectory(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """``FollowTrajectoryAction`` of a polyline with times, along the way. Between two vertices the speed is constant;
    sideways, the simulator's lane change leads through them."""
    trajectory = at.find("TrajectoryRef", "Trajectory") or at.find("Trajectory")
    if trajectory is None:
        raise at.refusal("FollowTrajectoryAction needs a Trajectory; catalogs of trajectories are not read")
    shape = trajectory.one("Shape").only()
    timing = at.find("TimeReference", "Timing")
    if shape.tag != "Polyline" or timing is None or "initialDistanceOffset" in at.attributes:
        raise shape.refusal("FollowTrajectoryAction is supported for a Polyline with Timing and without offset")
    relative = scope.text(timing, "domainAbsoluteRelative", "relative") == "relative"
    start_s = scope.number(timing, "offset", 0.0) + (stage.t_s if relative else 0.0)
    scale = scope.number(timing, "scale", 1.0)
    points = shape.all("Vertex")
    if not 2 <= len(points) <= _MOST_VERTICES or scale <= 0.0:
        raise shape.refusal(f"a trajectory needs 2 to {_MOST_VERTICES} vertices and a positive scale")
    vertices = []
    for each in points:
        place = place_at(each.one("Position"), scope, stage.road, stage.place_of)
        if place.way != mover.way:
            raise each.refusal(f"a trajectory that turns {shown(mover.body.name)} around is not supported")
        vertices.append(_Vertex(start_s + scale * scope.number(each, "time"), place.s_m, place.d_m))
    _begin(vertices[0], shape, mover, stage)
    return _drive([_Vertex(stage.t_s, vertices[0].s_m, vertices[0].d_m), *vertices[1:]], shape, mover, stage)


def _begin(first: _Vertex, at: XmlElement, mover: Mover, stage: PlayedScenario) -> None:
    """The trajectory begins now, where the vehicle is; at the start, the vehicle is put there."""
    here = mover.place_now(stage.t_s)
    if stage.t_s == 0.0 and first.t_s == 0.0:
        mover.place(here._replace(s_m=first.s_m, d_m=first.d_m))
        return
    if abs(first.s_m - here.s_m) > _AWAY_M or abs(first.d_m - here.d_m) > _BESIDE_M or abs(first.t_s - stage.t_s) > 0.1:
        away_m, beside_m, early_s = first.s_m - here.s_m, first.d_m - here.d_m, stage.t_s - first.t_s
        raise at.refusal(
            f"the trajectory of {shown(mover.body.name)} begins {away_m:.1f} m ahead of it, {beside_m:.1f} m beside it "
            f"and {early_s:.1f} s ago; it must begin where the vehicle is, now"
        )


def _drive(vertices: list[_Vertex], at: XmlElement, mover: Mover, stage: PlayedScenario) -> Running:
    """Speeds and lane changes through the vertices, which are the vehicle's reference point."""
    line, here = stage.road.road.line, mover.place_now(stage.t_s)
    corners = [(stage.t_s, mover.now(stage.t_s)[1].speed_mps)] if stage.t_s > 0.0 else []
    for before, after in pairwise([_Vertex(stage.t_s, here.s_m, here.d_m), *vertices[1:]]):
        driven_m = mover.way * line.driven_m(before.s_m, after.s_m, (before.d_m + after.d_m) / 2)
        if after.t_s - before.t_s <= 2 * _STEP_S or driven_m < -_STRAIGHT_M:
            raise at.refusal("the vertices of a trajectory must lead ahead, with times that rise")
        speed_mps = max(driven_m, 0.0) / (after.t_s - before.t_s)
        corners += [(before.t_s + (_STEP_S if corners else 0.0), speed_mps), (after.t_s, speed_mps)]
    ends_s = mover.plan_speed(corners, at, vertices[-1].t_s)
    for first, last in _changes([_Vertex(stage.t_s, here.s_m, here.d_m), *vertices[1:]]):
        mover.change_lane(first.t_s, last.d_m, last.t_s - first.t_s, at)
    for each in vertices[1:]:
        away_m = abs(mover.now(each.t_s)[1].d_m - each.d_m)
        if away_m > _SHAPE_M:
            raise at.refusal(f"a trajectory that a lane change passes by {away_m:.1f} m is not supported")
    return SpeedChange(mover, ends_s, mover.speed_version)


def _changes(vertices: list[_Vertex]) -> list[tuple[_Vertex, _Vertex]]:
    """The stretches in which the offset rises, or falls, throughout."""
    found: list[tuple[_Vertex, _Vertex]] = []
    rising = 0
    for before, after in pairwise(vertices):
        step = after.d_m - before.d_m
        sign = 0 if abs(step) < _STRAIGHT_M else (1 if step > 0.0 else -1)
        if sign and sign == rising:
            found[-1] = (found[-1][0], after)
        elif sign:
            found.append((before, after))
        rising = sign
    return found
