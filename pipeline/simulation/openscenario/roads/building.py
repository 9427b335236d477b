"""Builds the driven road from the roads of a file and the place where the ego vehicle starts."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import remainder, tau
from typing import Any

import numpy as np
from pydantic import ValidationError

from pipeline.common.files.user_file_errors import first_complaint
from pipeline.simulation.openscenario.roads.arc_fit import fit_arcs
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.roads.elevation import humps
from pipeline.simulation.openscenario.roads.free_line import FreeLine
from pipeline.simulation.openscenario.roads.lane_sections import Cubics
from pipeline.simulation.openscenario.roads.network import FileRoad, Network
from pipeline.simulation.openscenario.roads.track import TrackedStretch, track_along, track_of
from pipeline.simulation.openscenario.roads.way import AHEAD_M, BEHIND_M, Stretch, WayFinder
from pipeline.simulation.world.lines import WorldPose
from pipeline.simulation.world.roads import Road, Segment
from pipeline.types import F64

_GAP_M, _KINK_RAD = 0.5, 0.03
"""Roads that meet with more than this are not driven from one onto the other."""
_SAME_M = 1e-3
_NARROWEST_M, _WIDEST_SHOULDER_M = 0.5, 10.0

_MIRRORED = "The road has left-hand traffic; it is simulated as its mirror image, on the right."
_BANKED = "Superelevation of the road is left out: it is not banked."
_UNDRAWN = "Of the other roads of the file, only those straight across are drawn."
_ONE_SECTION = "Lanes are drawn as they are at the ego vehicle's start, along the whole road."


def driven_road(
    network: Network, road: FileRoad, s_m: float, lane: int, way: int, wanted: frozenset[str] = frozenset()
) -> DrivenRoad:
    """The way through a place on a lane of the file. way: direction along the file's road; wanted: roads to take at
    junctions. OpenScenarioError says what cannot be simulated."""
    finder = WayFinder(network, wanted)
    ahead = _tracks(finder.follow(road, s_m, lane, way, AHEAD_M), road, s_m)
    return _made(finder, network, road, s_m, lane, way, ahead)


def road_along(
    network: Network, road: FileRoad, s_m: float, t_m: float, lane: int, way: int, line: FreeLine
) -> DrivenRoad:
    """The same for a vehicle that follows a trajectory from a place on a road: its way is the road, with the lanes of
    its start. t_m: of its start; line: the trajectory from there on."""
    start_t = float(road.lanes.centre.at(np.array([s_m]))[0])
    stretch = Stretch(road, road.lanes.section_at(s_m), way, lane, s_m, s_m + way * line.length_m)
    ahead = [track_of(line, stretch, start_t, t_m)]
    return _made(WayFinder(network, frozenset()), network, road, s_m, lane, way, ahead)


def _made(
    finder: WayFinder, network: Network, road: FileRoad, s_m: float, lane: int, way: int, ahead: list[TrackedStretch]
) -> DrivenRoad:
    """The road of what lies ahead of a start, and of the way that leads there."""
    behind = [_turned(each) for each in reversed(_tracks(finder.follow(road, s_m, lane, -way, BEHIND_M), road, s_m))]
    hand = -1 if road.is_left_hand else 1
    try:
        tracks, segments, start = _joined([*behind, *ahead], hand)
        here = tracks[len(behind)]
        height_m = np.concatenate([_elevation(each) for each in tracks])
        crests, crest_note = humps(np.concatenate([each.at_m for each in tracks]), height_m)
        made = Road(segments=segments, humps_per_m=crests, **_cross_section(here, hand))
    except ValidationError as error:
        raise road.at.refusal(first_complaint(error, Road)) from None
    notes = [
        *finder.notes,
        *([crest_note] if crest_note else []),
        *([_MIRRORED] if hand < 0 else []),
        *([_BANKED] if any(_is_banked(each.road) for each in tracks) else []),
        *([_UNDRAWN] if len(network.roads) > 1 else []),
        *([_ONE_SECTION] if any(_is_other(each, here) for each in tracks) else []),
    ]
    return DrivenRoad(network, tuple(tracks), made, start, hand, tuple(dict.fromkeys(notes)))


def _tracks(stretches: list[Stretch], road: FileRoad, s_m: float) -> list[TrackedStretch]:
    """The reference line along stretches, from lane 0 at the start, as far as they join."""
    found: list[TrackedStretch] = []
    for stretch in stretches:
        if abs(stretch.to_m - stretch.from_m) < _SAME_M:
            continue
        start_t = float(road.lanes.centre.at(np.array([s_m]))[0])
        track = track_along(stretch, found[-1] if found else None, start_t)
        if found:
            gap = track.poses[0, :2] - found[-1].poses[-1, :2]
            kink = remainder(float(track.poses[0, 2] - found[-1].poses[-1, 2]), tau)
            if float(np.hypot(*gap)) > _GAP_M or abs(kink) > _KINK_RAD:
                break
        found.append(track)
    return found


def _turned(track: TrackedStretch) -> TrackedStretch:
    """The same in the other direction."""
    stretch = replace(track.stretch, way=-track.way, from_m=track.stretch.to_m, to_m=track.stretch.from_m)
    poses = track.poses[::-1] + np.array([0.0, 0.0, np.pi * track.way])
    return TrackedStretch(stretch, track.s_m[::-1], track.t_m[::-1], poses, track.lane_t_m[::-1], track.at_m)


def _joined(tracks: list[TrackedStretch], hand: int) -> tuple[list[TrackedStretch], tuple[Segment, ...], WorldPose]:
    """The tracks with their distances along the way, its segments, and its beginning in the file's world. A road that
    is driven along its own reference line keeps its geometries; other lines are fitted by arcs."""
    poses = np.concatenate([each.poses for each in tracks])
    start: WorldPose = (float(poses[0, 0]), float(poses[0, 1]), float(poses[0, 2]))
    exact = _own_segments(tracks, hand)
    if exact is not None:
        return [each.with_distances(each.s_m) for each in tracks], exact, start
    kept = _ascending(poses)
    fitted = fit_arcs(poses[kept])
    at_kept = np.interp(np.arange(len(kept)), fitted.samples, fitted.at_m)
    at_m = np.interp(np.arange(len(poses)), kept, at_kept)
    ends = np.cumsum([0, *(len(each.s_m) for each in tracks)])
    segments = tuple(Segment(length_m=length, curvature_per_m=hand * bend) for length, bend in fitted.arcs)
    parts = zip(tracks, pairwise(ends.tolist()), strict=True)
    return [each.with_distances(at_m[first:end]) for each, (first, end) in parts], segments, start


def _own_segments(tracks: list[TrackedStretch], hand: int) -> tuple[Segment, ...] | None:
    """The geometries of a road along which the whole way leads; None if it leads elsewhere, or a geometry is a
    polynomial."""
    road = tracks[0].road
    if any(each.is_free or each.road is not road or each.way < 0 or np.abs(each.t_m).max() > 1e-9 for each in tracks):
        return None
    segments = [each.segment for each in road.line.geometries]
    found = [each for each in segments if each is not None]
    if len(found) < len(segments) or tracks[0].s_m[0] > _SAME_M:
        return None
    if hand > 0:
        return tuple(found)
    return tuple(
        replaced.model_copy(
            update={
                "curvature_per_m": -replaced.curvature_per_m,
                "end_curvature_per_m": None if replaced.end_curvature_per_m is None else -replaced.end_curvature_per_m,
            }
        )
        for replaced in found
    )


def _ascending(poses: F64) -> F64:
    """Numbers of the poses that lie ahead of those before them: roads overlap by millimetres where they meet."""
    kept = [0]
    for number in range(1, len(poses)):
        before, here = poses[kept[-1]], poses[number]
        ahead = (here[0] - before[0]) * np.cos(before[2]) + (here[1] - before[1]) * np.sin(before[2])
        if ahead > _SAME_M:
            kept.append(number)
    return np.array(kept)


def _elevation(track: TrackedStretch) -> F64:
    return track.road.heights_m(np.clip(track.s_m, 0.0, track.road.line.length_m) if track.is_free else track.s_m)


def _is_banked(road: FileRoad) -> bool:
    profile = road.at.find("lateralProfile")
    if profile is None:
        return False
    banks = Cubics(profile.all("superelevation"))
    return bool(np.abs(banks.at(np.linspace(0.0, road.line.length_m, 50))).max() > 1e-6)


def _is_other(track: TrackedStretch, here: TrackedStretch) -> bool:
    """Whether the lanes of a stretch differ from those at the start."""
    first, second = (
        [
            (lane.is_driven, round(float(lane.width.at(each.s_m[:1])[0]), 2))
            for lane in each.stretch.section.lanes.values()
        ]
        for each in (track, here)
    )
    return first != second or any(not lane.width.is_constant for lane in track.stretch.section.lanes.values())


def _cross_section(track: TrackedStretch, hand: int) -> dict[str, Any]:
    """Lanes as the simulator has them, at the beginning of a stretch."""
    edges = track.lane_edges(float(track.at_m[0]), hand, driven_only=False)
    section = track.stretch.section
    sides: dict[int, list[int]] = {1: [], -1: []}
    for lane in sorted(section.lanes, key=abs):
        sides[track.way * track.road.traffic_way(lane)].append(lane)
    forward, outer = _lane_lines(sides[1], section, edges)
    oncoming, _ = _lane_lines(sides[-1], section, edges)
    if not forward:
        raise track.road.at.refusal("no driving lane in the ego vehicle's direction where it starts")
    return {
        "forward_edges_m": forward,
        "oncoming_edges_m": oncoming,
        "shoulder_m": min(outer, _WIDEST_SHOULDER_M),
        "painted": section.is_painted,
    }


def _lane_lines(
    side: list[int], section: Any, edges: dict[int, tuple[float, float]]
) -> tuple[tuple[float, ...], float]:
    """d of the lines from the innermost driving lane outwards, and the width beyond the outermost."""
    wide = [lane for lane in side if abs(edges[lane][1] - edges[lane][0]) >= _NARROWEST_M]
    driven = [i for i, lane in enumerate(wide) if section.lanes[lane].is_driven]
    if not driven:
        return (), 0.0
    lanes = wide[driven[0] : driven[-1] + 1]
    lines = (edges[lanes[0]][0], *(edges[lane][1] for lane in lanes))
    return tuple(round(line, 9) for line in lines), abs(edges[side[-1]][1] - lines[-1])
