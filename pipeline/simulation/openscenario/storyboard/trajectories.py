"""Trajectories of OpenSCENARIO as lines in the file's world: polylines, clothoids, splines of clothoids, NURBS."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.roads.free_line import LONGEST_M, FreeLine, clothoid, nurbs, polyline
from pipeline.simulation.openscenario.storyboard.positions import Entities
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown
from pipeline.simulation.world.lines import WorldPose

_MOST_POINTS = 2_000
_GAP_M = 0.5
"""Segments of a spline that meet with more than this are refused."""
_SHAPES = "Polyline, Clothoid, ClothoidSpline and Nurbs are"

PointTimes = tuple[tuple[float, float], ...]
"""(s, seconds) pairs along a trajectory, before its scale and offset."""


@dataclass(frozen=True)
class Trajectory:
    """A line that an entity follows."""

    line: FreeLine
    """In the file's world."""
    times: PointTimes
    """When it is where; empty if the file says nothing."""
    at: XmlElement
    """Its shape in the file."""


def trajectory_of(action: XmlElement) -> XmlElement:
    """The ``Trajectory`` of a ``FollowTrajectoryAction``."""
    found = action.find("TrajectoryRef", "Trajectory") or action.find("Trajectory")
    if found is None:
        raise action.refusal("FollowTrajectoryAction needs a Trajectory")
    return found


def read_trajectory(
    at: XmlElement, scope: ParameterScope, entities: Entities, here: WorldPose | None = None
) -> Trajectory:
    """A ``Trajectory``. here: where the entity that follows it is, for those that begin there; None if that is not
    known. OpenScenarioError if it cannot be simulated."""
    shape = at.one("Shape").only()
    reader = {"Polyline": _polyline, "Clothoid": _clothoid, "ClothoidSpline": _spline, "Nurbs": _nurbs}.get(shape.tag)
    if reader is None:
        raise shape.refusal(f"a trajectory of {shown(shape.tag)} is not supported; {_SHAPES}")
    try:
        line, times = reader(shape, scope, entities, here)
    except OpenScenarioError:
        raise
    except ValueError as error:
        raise shape.refusal(f"this trajectory is not supported: {error}") from None
    if line.length_m > LONGEST_M:
        raise shape.refusal(f"a trajectory may be {LONGEST_M / 1e3:g} km long at most")
    return Trajectory(line, times, shape)


def _polyline(
    at: XmlElement, scope: ParameterScope, entities: Entities, here: WorldPose | None
) -> tuple[FreeLine, PointTimes]:
    vertices = at.all("Vertex")
    _check_count(vertices, at)
    line, s_m = polyline([entities.pose_at(each.one("Position"), scope)[:2] for each in vertices])
    return line, _timed(vertices, s_m, scope)


def _nurbs(
    at: XmlElement, scope: ParameterScope, entities: Entities, here: WorldPose | None
) -> tuple[FreeLine, PointTimes]:
    controls, knots = at.all("ControlPoint"), at.all("Knot")
    _check_count(controls, at)
    points = np.array([entities.pose_at(each.one("Position"), scope)[:2] for each in controls])
    weights = np.array([scope.number(each, "weight", 1.0) for each in controls])
    line, s_m = nurbs(
        points, weights, np.array([scope.number(each, "value") for each in knots]), scope.integer(at, "order")
    )
    return line, _timed(controls, s_m, scope)


def _check_count(points: list[XmlElement], at: XmlElement) -> None:
    if not 2 <= len(points) <= _MOST_POINTS:
        raise at.refusal(f"a trajectory needs 2 to {_MOST_POINTS} points")


def _timed(points: list[XmlElement], s_m: list[float], scope: ParameterScope) -> PointTimes:
    """PointTimes of the points that have one, if the last one has."""
    if "time" not in points[-1].attributes:
        return ()
    return tuple(
        (s, scope.number(each, "time")) for each, s in zip(points, s_m, strict=True) if "time" in each.attributes
    )


def _clothoid(
    at: XmlElement, scope: ParameterScope, entities: Entities, here: WorldPose | None
) -> tuple[FreeLine, PointTimes]:
    """``curvatureDot`` is what version 1.0 calls ``curvaturePrime``: the change of curvature along the line."""
    length, bend = scope.number(at, "length"), scope.number(at, "curvature")
    rate = scope.number(at, "curvaturePrime" if "curvaturePrime" in at.attributes else "curvatureDot")
    start = at.find("Position")
    line = _bend(at, _start(at, start, scope, entities, here), length, bend, bend + rate * length)
    if "stopTime" not in at.attributes:
        return line, ()
    return line, ((0.0, scope.number(at, "startTime", 0.0)), (length, scope.number(at, "stopTime")))


def _spline(
    at: XmlElement, scope: ParameterScope, entities: Entities, here: WorldPose | None
) -> tuple[FreeLine, PointTimes]:
    segments = at.all("ClothoidSplineSegment")
    if not 1 <= len(segments) <= _MOST_POINTS:
        raise at.refusal(f"a ClothoidSpline needs 1 to {_MOST_POINTS} segments")
    line: FreeLine | None = None
    times: list[tuple[float, float]] = []
    for each in segments:
        position, s_m = each.find("PositionStart"), line.length_m if line is not None else 0.0
        start = line.pose(s_m) if line is not None else _start(each, position, scope, entities, here)
        if line is not None and position is not None:
            x, y, _ = entities.pose_at(position, scope)
            if hypot(x - start[0], y - start[1]) > _GAP_M:
                raise each.refusal("this segment does not begin where the one before it ends")
        if scope.number(each, "hOffset", 0.0) != 0.0:
            raise each.refusal("a ClothoidSplineSegment with an hOffset has a kink, which is not supported")
        ends = scope.number(each, "curvatureStart"), scope.number(each, "curvatureEnd")
        piece = _bend(each, start, scope.number(each, "length"), *ends)
        if "timeStart" in each.attributes:
            times.append((s_m, scope.number(each, "timeStart")))
        line = piece if line is None else line.then(piece)
    assert line is not None
    if "timeEnd" in at.attributes:
        times.append((line.length_m, scope.number(at, "timeEnd")))
    return line, tuple(times) if len(times) > 1 else ()


def _bend(at: XmlElement, start: WorldPose, length_m: float, from_per_m: float, to_per_m: float) -> FreeLine:
    if not 0.0 < length_m <= LONGEST_M:
        raise at.refusal(f"{at.tag} length={length_m:g}: expected a positive number up to {LONGEST_M:g}")
    return clothoid(start, length_m, from_per_m, to_per_m)


def _start(
    at: XmlElement, position: XmlElement | None, scope: ParameterScope, entities: Entities, here: WorldPose | None
) -> WorldPose:
    if position is not None:
        return entities.pose_at(position, scope)
    if here is None:
        raise at.refusal(f"{at.tag} has no start position, and no vehicle is where it begins")
    return here
