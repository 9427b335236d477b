"""One road of an ASAM OpenDRIVE file as a road of the simulator: lines, arcs and spirals, with driving lanes of one
width on both sides of the reference line."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, remainder, sin, tau

import numpy as np
from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint
from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import XmlElement, shown
from pipeline.simulation.world.lines import RoadLine, WorldPose
from pipeline.simulation.world.roads import Road, Segment

_SAME_M, _SAME_RAD = 0.1, 0.01
"""Maximum gap and kink between two geometries that are called continuous: files give about a millimetre."""
_SAME_WIDTH_M = 0.01
_MOST_ARCS = 20_000
"""10 km of spirals as the simulator divides them; more would take minutes."""
_SEARCH_STEP_M = 0.5
_WIDEST_SHOULDER_M = 10.0
_SCOPE = ParameterScope()
"""OpenDRIVE has no parameters."""


@dataclass(frozen=True)
class DrivenRoad:
    """The road on which a scenario takes place."""

    id: str
    """In the OpenDRIVE file."""
    length_m: float
    """Of its reference line."""
    road: Road
    """As simulated; its world begins at s = 0 with heading 0."""
    start: WorldPose
    """x, y and heading of s = 0 in the file's world."""
    lanes: dict[int, float]
    """Lane in the file → d of its middle, of all driving lanes."""

    def heading(self, s_m: float) -> float:
        """Heading of the reference line in the file's world."""
        return self.start[2] + float(self.road.to_world(s_m, 0.0)[0, 2])

    def to_file_world(self, s_m: float, d_m: float) -> tuple[float, float]:
        """x and y in the file's world."""
        x, y, _ = self.road.to_world(s_m, d_m)[0].tolist()
        x0, y0, turned = self.start
        return x0 + x * cos(turned) - y * sin(turned), y0 + x * sin(turned) + y * cos(turned)

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """s and d of the nearest place on the road to a point in the file's world."""
        x0, y0, turned = self.start
        away_x, away_y = x_m - x0, y_m - y0
        x, y = away_x * cos(turned) + away_y * sin(turned), away_y * cos(turned) - away_x * sin(turned)
        s = np.arange(0.0, self.length_m + _SEARCH_STEP_M, _SEARCH_STEP_M)
        line = self.road.to_world(s, 0.0)
        nearest = int(np.argmin(np.hypot(line[:, 0] - x, line[:, 1] - y)))
        s_m, d_m = float(s[nearest]), 0.0
        for _ in range(5):  # Newton's steps along the tangent converge within a micrometre
            px, py, heading = self.road.to_world(s_m, 0.0)[0].tolist()
            s_m += (x - px) * cos(heading) + (y - py) * sin(heading)
            d_m = (y - py) * cos(heading) - (x - px) * sin(heading)
        return s_m, d_m


def road_of(root: XmlElement, wanted: str | None) -> DrivenRoad:
    """The road with this id; None: the file's only one. OpenScenarioError says what cannot be simulated."""
    roads = root.all("road")
    if wanted is None and len(roads) != 1:
        raise root.refusal(f"{len(roads)} roads; a position without roadId needs exactly one")
    at = next((each for each in roads if wanted is None or each.attributes.get("id") == wanted), None)
    if at is None:
        raise root.refusal(f"no road {shown(wanted or '')!r}")
    if at.attributes.get("rule", "RHT") != "RHT":
        raise at.refusal("rule=LHT is not supported: the simulator drives on the right")
    _check_flat(at)
    segments, start = _line(at)
    sections = at.one("lanes").all("laneSection")
    if len(sections) != 1:
        raise at.refusal(f"{len(sections)} lane sections; the simulator's roads have one")
    try:
        road, lanes = _with_lanes(sections[0], segments)
    except ValidationError as error:
        raise at.refusal(first_complaint(error, Road)) from None
    return DrivenRoad(at.attributes.get("id", ""), sum(each.length_m for each in segments), road, start, lanes)


def _check_flat(at: XmlElement) -> None:
    """Elevation, superelevation and an offset of the lanes are accepted if constant and, but for elevation, zero."""
    profiles = (("elevationProfile", "elevation"), ("lateralProfile", "superelevation"), ("lanes", "laneOffset"))
    for inside, name in profiles:
        found = at.find(inside)
        for each in found.all(name) if found is not None else []:
            changing = [_SCOPE.number(each, key, 0.0) for key in "bcd"]
            constant = 0.0 if name == "elevation" else _SCOPE.number(each, "a", 0.0)
            if any(changing) or constant:
                raise each.refusal(f"{name} is not supported: the simulator's roads are flat, with lanes side by side")


def _line(at: XmlElement) -> tuple[list[Segment], WorldPose]:
    """The segments of its reference line, and the pose at s = 0."""
    segments: list[Segment] = []
    begins: list[WorldPose] = []
    arcs = 0
    for each in at.one("planView").all("geometry"):
        begins.append((_SCOPE.number(each, "x"), _SCOPE.number(each, "y"), _SCOPE.number(each, "hdg")))
        if segments:
            _check_joint(each, segments[-1], begins[-2], begins[-1])
        try:
            segments.append(_segment(each))
        except ValidationError as error:
            raise each.refusal(first_complaint(error, Segment)) from None
        arcs += len(segments[-1].arcs())
        if arcs > _MOST_ARCS:
            raise each.refusal("this road has too many geometries, or too long spirals")
    if not segments:
        raise at.refusal("planView has no geometry")
    return segments, begins[0]


def _check_joint(at: XmlElement, before: Segment, began: WorldPose, begins: WorldPose) -> None:
    """A geometry begins where the one before it ends."""
    x, y, heading = RoadLine(before.arcs(), began).to_world(before.length_m, 0.0)[0].tolist()
    kink = remainder(begins[2] - heading, tau)
    if hypot(begins[0] - x, begins[1] - y) > _SAME_M or abs(kink) > _SAME_RAD:
        raise at.refusal("this geometry does not begin where the previous one ends")


def _segment(at: XmlElement) -> Segment:
    length, shape = _SCOPE.number(at, "length"), at.only()
    if shape.tag == "line":
        return Segment(length_m=length)
    if shape.tag == "arc":
        return Segment(length_m=length, curvature_per_m=_SCOPE.number(shape, "curvature"))
    if shape.tag == "spiral":
        ends = _SCOPE.number(shape, "curvStart"), _SCOPE.number(shape, "curvEnd")
        return Segment(length_m=length, curvature_per_m=ends[0], end_curvature_per_m=ends[1])
    raise shape.refusal(f"{shown(shape.tag)} is not supported; line, arc and spiral are")


def _with_lanes(section: XmlElement, segments: list[Segment]) -> tuple[Road, dict[int, float]]:
    """The road, and the d of every driving lane."""
    right, left = _side(section, "right", -1), _side(section, "left", 1)
    if not right.lanes:
        raise section.refusal("no driving lane to the right of the reference line")
    if left.lanes and (
        abs(left.width_m - right.width_m) > _SAME_WIDTH_M or abs(left.inner_m - right.inner_m) > _SAME_WIDTH_M
    ):
        raise section.refusal("the driving lanes of both sides must have one width and begin equally far out")
    road = Road(
        segments=tuple(segments),
        lane_width_m=right.width_m,
        lanes_forward=len(right.lanes),
        lanes_oncoming=len(left.lanes),
        median_m=2.0 * right.inner_m,
        shoulder_m=min(right.outer_m, _WIDEST_SHOULDER_M),
        painted=any(_is_painted(lane) for lane in section.below() if lane.tag == "lane"),
    )
    places = {lane: -right.inner_m - (i + 0.5) * right.width_m for i, lane in enumerate(right.lanes)}
    return road, places | {lane: left.inner_m + (i + 0.5) * left.width_m for i, lane in enumerate(left.lanes)}


@dataclass(frozen=True)
class _Side:
    """One side of a road, from the middle outwards."""

    lanes: list[int]
    width_m: float
    inner_m: float
    outer_m: float


def _side(section: XmlElement, name: str, sign: int) -> _Side:
    found = section.find(name)
    lanes = sorted(found.all("lane") if found is not None else [], key=lambda lane: abs(_SCOPE.integer(lane, "id")))
    ids = [_SCOPE.integer(lane, "id") for lane in lanes]
    if ids != [sign * (i + 1) for i in range(len(ids))]:
        raise (found or section).refusal(f"the lanes of the {name} side are not numbered from {sign} outwards")
    widths = [_width(lane) for lane in lanes]
    is_driving = [lane.attributes.get("type") == "driving" for lane in lanes]
    driving = [i for i, each in enumerate(is_driving) if each]
    if not driving:
        return _Side([], 0.0, 0.0, sum(widths))
    first, last = driving[0], driving[-1]
    if not all(is_driving[first : last + 1]) or max(widths[first : last + 1]) - min(widths[first : last + 1]) > (
        _SAME_WIDTH_M
    ):
        raise section.refusal(f"the driving lanes of the {name} side must lie side by side and have one width")
    return _Side(ids[first : last + 1], widths[first], sum(widths[:first]), sum(widths[last + 1 :]))


def _width(lane: XmlElement) -> float:
    """Of a lane, which must be constant."""
    entries = lane.all("width")
    if len(entries) != 1 or any(_SCOPE.number(entries[0], key, 0.0) for key in "bcd"):
        raise lane.refusal("a lane must have one constant width")
    return _SCOPE.number(entries[0], "a")


def _is_painted(lane: XmlElement) -> bool:
    return any(mark.attributes.get("type", "none") != "none" for mark in lane.all("roadMark"))
