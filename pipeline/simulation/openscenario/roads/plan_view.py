"""The reference line of an OpenDRIVE road: lines, arcs, spirals and polynomials, at any distance along it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import ceil, hypot, remainder, tau

import numpy as np
from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.lines import RoadLine, WorldPose
from pipeline.simulation.world.roads import Segment
from pipeline.types import F64

_SAME_M, _SAME_RAD = 0.1, 0.01
"""Maximum gap and kink between two geometries that are called continuous: files give about a millimetre."""
_MOST_ARCS = 20_000
"""10 km of spirals as the simulator divides them; more would take minutes."""
_LONGEST_POLYNOMIAL_M = 5_000.0
_TABLE_STEP_M = 0.25
"""Between two points at which the length of a polynomial is added up: exact within 1 µm at 20 m radius."""
_LENGTH_ERROR = 0.05
"""Maximum share by which a polynomial's length may differ from the attribute, to which it is then scaled."""
_SCOPE = ParameterScope()
"""OpenDRIVE has no parameters."""


@dataclass(frozen=True)
class Geometry:
    """One piece of a reference line."""

    at: XmlElement
    """In the file."""
    start: WorldPose
    """Its beginning in the file's world, as written."""
    length_m: float
    """Along the line."""
    segment: Segment | None
    """The same as a segment of the simulator; None for a polynomial."""
    pose_at: Callable[[F64], F64]
    """(N,) metres from its beginning → (N, 4) x, y, heading and curvature in the file's world."""


class PlanView:
    """The reference line of one road."""

    def __init__(self, road: XmlElement) -> None:
        """OpenScenarioError if a geometry is unknown, or does not begin where the one before it ends."""
        self.geometries: list[Geometry] = []
        arcs = 0
        for each in road.one("planView").all("geometry"):
            found = _geometry(each)
            if self.geometries:
                _check_joint(self.geometries[-1], found)
            self.geometries.append(found)
            arcs += len(found.segment.arcs()) if found.segment is not None else ceil(found.length_m)
            if arcs > _MOST_ARCS:
                raise each.refusal("this road has too many geometries, or too long spirals")
        if not self.geometries:
            raise road.refusal("planView has no geometry")

    @cached_property
    def joints_m(self) -> F64:
        """(G + 1,) s where geometries begin, and the end."""
        return np.concatenate([[0.0], np.cumsum([each.length_m for each in self.geometries])])

    @property
    def length_m(self) -> float:
        return float(self.joints_m[-1])

    def at(self, s_m: F64) -> F64:
        """(N, 4) x, y, heading and curvature at (N,) s; beyond its ends, of the nearest end."""
        s = np.clip(s_m, 0.0, self.length_m)
        index = np.clip(np.searchsorted(self.joints_m, s, side="right") - 1, 0, len(self.geometries) - 1)
        found = np.empty((len(s), 4))
        for number in np.unique(index).tolist():
            here = index == number
            found[here] = self.geometries[number].pose_at(s[here] - self.joints_m[number])
        return found

    def offset(self, s_m: F64, t_m: F64) -> F64:
        """(N, 2) x, y of points ``t_m`` to the left of the line."""
        x, y, heading, _ = self.at(s_m).T
        return np.column_stack([x - t_m * np.sin(heading), y + t_m * np.cos(heading)])


def _check_joint(before: Geometry, here: Geometry) -> None:
    x, y, heading, _ = before.pose_at(np.array([before.length_m]))[0].tolist()
    kink = remainder(here.start[2] - heading, tau)
    if hypot(here.start[0] - x, here.start[1] - y) > _SAME_M or abs(kink) > _SAME_RAD:
        raise here.at.refusal("this geometry does not begin where the previous one ends")


def _geometry(at: XmlElement) -> Geometry:
    start = _SCOPE.number(at, "x"), _SCOPE.number(at, "y"), _SCOPE.number(at, "hdg")
    length = _SCOPE.number(at, "length")
    shapes = [each for each in at.children if each.tag != "userData"]
    if len(shapes) != 1:
        raise at.refusal(f"geometry has {len(shapes)} elements; expected one")
    shape = shapes[0]
    if shape.tag in ("poly3", "paramPoly3"):
        return Geometry(at, start, length, None, _polynomial(shape, start, length))
    try:
        segment = _segment(shape, length)
    except ValidationError as error:
        raise at.refusal(first_complaint(error, Segment)) from None
    arcs = segment.arcs()
    line = RoadLine(arcs, start)
    ends = np.cumsum([each[0] for each in arcs])
    begin_bend = segment.curvature_per_m
    bend_rate = ((segment.end_curvature_per_m or begin_bend) - begin_bend) / length if len(arcs) > 1 else 0.0

    def pose_at(along_m: F64) -> F64:
        along = np.minimum(along_m, ends[-1])
        return np.column_stack([line.to_world(along, 0.0), begin_bend + bend_rate * along])

    return Geometry(at, start, length, segment, pose_at)


def _segment(shape: XmlElement, length_m: float) -> Segment:
    if shape.tag == "line":
        return Segment(length_m=length_m)
    if shape.tag == "arc":
        return Segment(length_m=length_m, curvature_per_m=_SCOPE.number(shape, "curvature"))
    if shape.tag == "spiral":
        ends = _SCOPE.number(shape, "curvStart"), _SCOPE.number(shape, "curvEnd")
        return Segment(length_m=length_m, curvature_per_m=ends[0], end_curvature_per_m=ends[1])
    raise shape.refusal(f"{shown(shape.tag)} is not supported; line, arc, spiral, poly3 and paramPoly3 are")


def _polynomial(shape: XmlElement, start: WorldPose, length_m: float) -> Callable[[F64], F64]:
    """A cubic curve by its arc length: a table of the length over the parameter, scaled to the attribute ``length``."""
    if not 0.0 < length_m <= _LONGEST_POLYNOMIAL_M:
        raise shape.refusal(f"a {shape.tag} must be 0 to {_LONGEST_POLYNOMIAL_M:g} m long")
    if shape.tag == "poly3":
        u, v = [0.0, 1.0, 0.0, 0.0], [_SCOPE.number(shape, key) for key in "abcd"]
        span = length_m
    else:
        u, v = ([_SCOPE.number(shape, f"{key}{axis}") for key in "abcd"] for axis in "UV")
        span = 1.0 if _SCOPE.text(shape, "pRange", "normalized") == "normalized" else length_m
    curve_u, curve_v = (np.polynomial.Polynomial(coefficients) for coefficients in (u, v))
    speed_u, speed_v = curve_u.deriv(), curve_v.deriv()
    bend_u, bend_v = speed_u.deriv(), speed_v.deriv()
    parameters = np.linspace(0.0, span, ceil(length_m / _TABLE_STEP_M) + 9)
    if float(np.hypot(speed_u(parameters), speed_v(parameters)).min()) * span < length_m / 100.0:
        raise shape.refusal(f"this {shape.tag} stands still or has a cusp")
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(curve_u(parameters)), np.diff(curve_v(parameters))))])
    if shape.tag == "paramPoly3" and abs(lengths[-1] / length_m - 1.0) > _LENGTH_ERROR:
        raise shape.refusal(f"this {shape.tag} is {lengths[-1]:.4g} m long, but its length says {length_m:.4g} m")
    if shape.tag == "poly3":  # u is not the length: the curve is as long as the attribute says
        parameters = parameters[: int(np.searchsorted(lengths, length_m)) + 1]
        lengths = lengths[: len(parameters)]
    scale = 1.0 if shape.tag == "poly3" else length_m / float(lengths[-1])
    x0, y0, heading0 = start
    c, s = np.cos(heading0), np.sin(heading0)

    def pose_at(along_m: F64) -> F64:
        p = np.interp(along_m, lengths * scale, parameters)
        du, dv = speed_u(p), speed_v(p)
        bend = (du * bend_v(p) - dv * bend_u(p)) / np.hypot(du, dv) ** 3
        x, y = curve_u(p), curve_v(p)
        return np.column_stack([x0 + x * c - y * s, y0 + x * s + y * c, heading0 + np.arctan2(dv, du), bend])

    return pose_at
