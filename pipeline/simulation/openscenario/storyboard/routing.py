"""Routes, and trajectories along lanes or on lines of their own."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import hypot, pi

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.driven_road import OffTheWay
from pipeline.simulation.openscenario.roads.free_line import turned_rad
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.positions import place_at
from pipeline.simulation.openscenario.storyboard.running import Running, SpeedChange, TrajectoryRun
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario
from pipeline.simulation.openscenario.storyboard.trajectories import Trajectory, read_trajectory, trajectory_of
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
    """``AssignRouteAction`` or ``AcquirePositionAction``: nothing to do if it follows the entity's road, which it
    decided if it stands in the Init. OffTheWay otherwise."""
    waypoints = [
        each for each in at.below() if each.tag in ("Waypoint", "Position") and each.find("Position") is not None
    ]
    positions = [each.one("Position") for each in waypoints] or at.all("Position")
    if not positions:
        raise at.refusal(f"{at.tag} without positions is not supported")
    for position in positions:
        if position.only().tag.startswith("Relative"):
            raise position.refusal(f"a route with a {position.only().tag} is not supported")
        place_at(position, scope, mover.road, stage)


@dataclass(frozen=True)
class _Vertex:
    t_s: float
    s_m: float
    d_m: float


def follow_trajectory(at: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario) -> Running:
    """``FollowTrajectoryAction``. A polyline with times along the lanes of the entity's road is played as speeds and
    lane changes; any other trajectory is a line that the entity follows, at its own speed or by the times."""
    trajectory, timing = trajectory_of(at), at.find("TimeReference", "Timing")
    clock = _clock(timing, scope, stage) if timing is not None else None
    offset_m = scope.number(at, "initialDistanceOffset", 0.0)
    shape = trajectory.one("Shape").only()
    if clock is not None and shape.tag == "Polyline" and mover.line is None and offset_m == 0.0:
        vertices = _on_lanes(shape, mover, scope, stage, clock)
        if vertices is not None:
            _begin(vertices[0], shape, mover, stage)
            return _drive([_Vertex(stage.t_s, vertices[0].s_m, vertices[0].d_m), *vertices[1:]], shape, mover, stage)
    found = read_trajectory(trajectory, scope, stage, mover.pose(stage.t_s))
    if not 0.0 <= offset_m < found.line.length_m:
        raise at.refusal(
            f"initialDistanceOffset={offset_m:g} lies outside the trajectory of {found.line.length_m:.1f} m"
        )
    if mover.body.name != stage.ego:
        _check_begin(found, offset_m, mover, stage)
        mover.follow(found.line, offset_m, stage.t_s)
    elif stage.t_s > 0.0 or not stage.has_trajectory:
        raise at.refusal("a trajectory of the ego vehicle that leaves its lane is supported at the start only")
    before_m = mover.now(stage.t_s)[1].travelled_m - offset_m
    if clock is not None:
        _keep_times(found, before_m, clock, mover, stage)
    return TrajectoryRun(mover, before_m + found.line.length_m, mover.lane_version)


@dataclass(frozen=True)
class _Clock:
    """When the times of a trajectory are."""

    start_s: float
    scale: float

    def at(self, time_s: float) -> float:
        return self.start_s + self.scale * time_s


def _clock(timing: XmlElement, scope: ParameterScope, stage: PlayedScenario) -> _Clock:
    relative = scope.text(timing, "domainAbsoluteRelative", "relative") == "relative"
    start_s, scale = (
        scope.number(timing, "offset", 0.0) + (stage.t_s if relative else 0.0),
        scope.number(timing, "scale", 1.0),
    )
    if scale <= 0.0:
        raise timing.refusal("a trajectory needs a positive scale of its times")
    return _Clock(start_s, scale)


def _on_lanes(
    shape: XmlElement, mover: Mover, scope: ParameterScope, stage: PlayedScenario, clock: _Clock
) -> list[_Vertex] | None:
    """The vertices of a polyline as places on the entity's road; None if it leaves the road, turns the entity around or
    cannot be followed by lane changes."""
    points = shape.all("Vertex")
    if not 2 <= len(points) <= _MOST_VERTICES:
        raise shape.refusal(f"a trajectory needs 2 to {_MOST_VERTICES} points")
    vertices = []
    for each in points:
        try:
            place = place_at(each.one("Position"), scope, mover.road, stage)
        except OffTheWay:
            return None
        if place.way != mover.way:
            return None
        vertices.append(_Vertex(clock.at(scope.number(each, "time")), place.s_m, place.d_m))
    trial = mover.trial()
    _begin(vertices[0], shape, trial, stage)
    _drive([_Vertex(stage.t_s, vertices[0].s_m, vertices[0].d_m), *vertices[1:]], shape, trial, stage)
    fits = all(abs(trial.now(each.t_s)[1].d_m - each.d_m) <= _SHAPE_M for each in vertices[1:])
    return vertices if fits else None


def _check_begin(found: Trajectory, offset_m: float, mover: Mover, stage: PlayedScenario) -> None:
    """The trajectory begins where the entity is, in the direction in which it faces; at the start, it is put there."""
    (x, y, heading), (x0, y0, heading0) = found.line.pose(offset_m), mover.pose(stage.t_s)
    name = shown(mover.body.name)
    if stage.t_s > 0.0 and hypot(x - x0, y - y0) > _AWAY_M:
        raise found.at.refusal(
            f"the trajectory of {name} begins {hypot(x - x0, y - y0):.1f} m away from it; it must begin where it is"
        )
    if mover.body.kind != "pedestrian" and turned_rad(heading, heading0) > pi / 2:
        raise found.at.refusal(f"the trajectory of {name} leads behind it, and driving backwards is not supported")


def _keep_times(found: Trajectory, before_m: float, clock: _Clock, mover: Mover, stage: PlayedScenario) -> None:
    """Speeds by which a trajectory's places are reached at their times. before_m: travelled at its s = 0."""
    times = [(before_m + s_m, clock.at(time_s)) for s_m, time_s in found.times]
    if len(times) < 2:
        raise found.at.refusal("a trajectory with Timing needs times at its points")
    here = mover.now(stage.t_s)[1]
    ahead = [(here.travelled_m, stage.t_s), *(each for each in times if each[1] > stage.t_s + _STEP_S)]
    corners = [(stage.t_s, here.speed_mps)] if stage.t_s > 0.0 else []
    for (before, from_s), (after, to_s) in pairwise(ahead):
        if to_s - from_s <= 2 * _STEP_S or after < before - _STRAIGHT_M:
            raise found.at.refusal("the points of a trajectory must lead ahead, with times that rise")
        speed_mps = max(after - before, 0.0) / (to_s - from_s)
        corners += [(from_s + (_STEP_S if corners else 0.0), speed_mps), (to_s, speed_mps)]
    mover.plan_speed(corners, found.at, ahead[-1][1])


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
    line, here = mover.road.road.line, mover.place_now(stage.t_s)
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
