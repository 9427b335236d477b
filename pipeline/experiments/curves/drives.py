"""The drives of the curve experiment: every frame is run and scored once for each path source.

Truth is the vehicle in the ego lane, decidable while no vehicle is at the lane's edge and no nearer vehicle hides it.
Missing a lead that has just come into sight does not count until it can have been confirmed (``true_lead.InSight``).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.near_face import near_face_middle
from pipeline.experiments.true_lead import InSight, ScriptedWay, same_place, true_lead
from pipeline.params import Params, with_changes
from pipeline.path.corridor import nearest_on_path
from pipeline.run import only
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.detection_model import BoxNoise, LineNoise
from pipeline.simulation.sensors.rig import SensorRig
from pipeline.simulation.sensors.truth_lanes import lane_points
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.step import State, step
from pipeline.types import Frame, Path, Result
from pipeline.warm_up import warm_up

LIDAR_ALONE = "LiDAR alone"
_ALL = ("lanes", "gnss", "yaw_rate", "edges", "traffic")


def _only(*used: str) -> Mapping[str, bool]:
    """The parameters that leave the path these sources."""
    return {f"path.use_{each}": False for each in _ALL if each not in used}


SOURCES: Mapping[str, Mapping[str, bool]] = {
    "lane lines": _only("lanes"),
    "GNSS route": _only("gnss"),
    "yaw rate": _only("yaw_rate"),
    "road edges": _only("edges"),
    "other vehicles": _only("traffic"),
    "lane lines and yaw rate": _only("lanes", "yaw_rate"),
    "straight guess": _only(),
    "fused": {},
    LIDAR_ALONE: {},
}
"""The parameters that select each path source. The last entry has all sources but no camera, so neither boxes nor lane
lines."""
BOXES = BoxNoise(reach_m=105.0)
"""Errors and range as measured for the embedded detector (``truth_boxes``)."""
LINES = LineNoise()
LOOK_AHEAD_M = (10, 30, 60, 100)
_TRUE_WAY_M = 130.0
_BEYOND = 1.3

CurveVerdict = Literal["right", "missed", "decoy", "none", "false", "undecided"]


@dataclass(frozen=True)
class SourceFrames:
    """One drive with one set of path sources, with an entry per frame. (N, 4): values at 10, 30, 60 and 100 m."""

    t_s: tuple[float, ...]
    """Seconds since the start of the scenario."""
    verdicts: tuple[CurveVerdict, ...]
    """Whether the CIPV was correct."""
    lead_m: tuple[float | None, ...]
    """Distance of the true lead; None without one."""
    told: tuple[bool, ...]
    """Whether the car that cuts in was recognised."""
    errors_m: tuple[tuple[float, ...], ...]
    """(N, 4) lateral errors of the path; NaN beyond the end of the true path."""
    sigmas_m: tuple[tuple[float, ...], ...]
    """(N, 4) the path's own standard deviations at the same distances."""
    over_line_s: float | None = None
    """When the car that cuts in crosses the lane line; None if no car cuts in."""


def seen(scene: Scenario, lines: LineNoise | None = LINES) -> Iterator[tuple[World, Frame]]:
    """Yield each tick of a scripted drive, with given detections. lines: None if the road has no lane lines."""
    sensors = SensorRig(scene, scene.ego.start_m + scene.ego.travelled_m(scene.duration_s))
    for index in range(scene.frame_count()):
        now = world_state.at(scene, index / scene.rate_hz)
        frame = sensors.frame(now, index, round(now.t_s * 1e9), image=False)
        assert frame.camera is not None
        found = truth_boxes.boxes(now, frame.camera, BOXES, scene.seed, index)
        lanes = None if lines is None else lane_points(now, scene.road, frame.camera, lines, scene.seed, index)
        yield now, evolve(frame, raw_boxes=found, raw_lanes=lanes)


@dataclass(frozen=True)
class CurveFrame:
    """A frame with its ground truth."""

    now: World
    """The world that the frame shows."""
    frame: Frame
    """The frame as passed to the pipeline."""
    true_path: Path | None
    """The path really driven; None at the end of the road."""
    lead: ActorState | None
    """The first vehicle in the lane within the scored range; None without one."""
    is_doubtful: bool
    """Whether it cannot be decided which vehicle leads."""
    is_confirmable: bool
    """Whether the lead has been visible for long enough to be confirmed."""
    beyond: ActorState | None
    """The first vehicle in the lane within 4/3 of the scored range."""

    @property
    def lead_m(self) -> float | None:
        """Distance of the lead's rear; None without a decidable lead."""
        if self.lead is None or self.is_doubtful:
            return None
        return float(np.hypot(*self.lead.cuboid.center[:2]) - self.lead.cuboid.size[0] / 2)


def moments(scene: Scenario, frames: Iterable[tuple[World, Frame]], reach_m: float) -> Iterator[CurveFrame]:
    """Add the ground truth to each frame of a drive. reach_m: leads beyond this do not count."""
    way, in_sight = ScriptedWay.of(scene), InSight()
    for now, frame in frames:
        assert frame.camera is not None
        in_sight = in_sight.then(now, frame.camera)
        path = way.ahead(now, _TRUE_WAY_M)
        lead, at_the_edge = true_lead(now, path, reach_m)
        beyond, _ = true_lead(now, path, _BEYOND * reach_m)
        hidden = lead is not None and in_sight.is_hidden(lead.actor.id)
        confirmable = lead is not None and in_sight.is_confirmable(lead.actor.id)
        yield CurveFrame(now, frame, path, lead, at_the_edge or hidden, confirmable, beyond)


def driven(
    scene: Scenario,
    reach_m: float,
    names: Sequence[str] = tuple(SOURCES),
    over_line_s: float | None = None,
    settings: Mapping[str, Mapping[str, object]] = SOURCES,
    lines: LineNoise | None = LINES,
) -> dict[str, SourceFrames]:
    """Simulate the sensors once per frame, and run the pipeline once for each of the named sources. over_line_s: when a
    wheel of vehicle 2 crosses the lane line, if it cuts in. lines: None if the road has no lane lines."""
    warm_up()
    chosen = {name: with_changes(Params(), settings[name]) for name in names}
    states = dict.fromkeys(names, State())
    rows: dict[str, list[tuple[CurveFrame, Result]]] = {name: [] for name in names}
    for moment in moments(scene, seen(scene, lines), reach_m):
        for name, params in chosen.items():
            given = only(moment.frame, "lidar") if name == LIDAR_ALONE else moment.frame
            states[name], result = step(states[name], given, params)
            rows[name].append((moment, result))
    return {name: _frames(each, over_line_s) for name, each in rows.items()}


def _frames(rows: Sequence[tuple[CurveFrame, Result]], over_line_s: float | None) -> SourceFrames:
    return SourceFrames(
        tuple(moment.now.t_s for moment, _ in rows),
        tuple(judge(moment, result) for moment, result in rows),
        tuple(moment.lead_m for moment, _ in rows),
        tuple(over_line_s is not None and _is_told(moment.now, result, 2) for moment, result in rows),
        tuple(_errors_m(result.path, moment.true_path) for moment, result in rows),
        tuple(_sigmas_m(result.path) for _, result in rows),
        over_line_s,
    )


def judge(moment: CurveFrame, result: Result) -> CurveVerdict:
    """Compare the frame's CIPV with the true first vehicle in the lane."""
    chosen = result.chosen()
    place = near_face_middle(chosen.bev) if chosen is not None and chosen.bev is not None else None
    if moment.is_doubtful:
        return "undecided"
    if moment.lead is None:
        is_beyond = place is not None and moment.beyond is not None and same_place(place, moment.beyond)
        return "none" if place is None else "undecided" if is_beyond else "false"
    if place is None:
        return "missed" if moment.is_confirmable else "undecided"
    return "right" if same_place(place, moment.lead) else "decoy"


def _is_told(now: World, result: Result, actor: int) -> bool:
    """Whether the car that cuts in is the CIPV or announced as a cut-in."""
    state = next(each for each in now.actors if each.actor.id == actor)
    known = {lead.id for lead in (result.cipv, result.next_cipv) if lead is not None}
    places = [near_face_middle(item.bev) for item in result.objects if item.id in known and item.bev is not None]
    return any(same_place(place, state) for place in places)


def _errors_m(path: Path, true_path: Path | None) -> tuple[float, ...]:
    """Lateral distance of the path's points at 10, 30, 60 and 100 m from the path really driven."""
    if true_path is None:
        return (np.nan,) * len(LOOK_AHEAD_M)
    points = path.center[[min(s, len(path.center) - 1) for s in LOOK_AHEAD_M]]
    off, along = nearest_on_path(true_path, points)
    length = float(np.hypot(*np.diff(true_path.center, axis=0).T).sum())
    return tuple(float(o) if a < length else np.nan for o, a in zip(off, along, strict=True))


def _sigmas_m(path: Path) -> tuple[float, ...]:
    return tuple(float(path.profile_m[min(s, len(path.profile_m) - 1)]) for s in LOOK_AHEAD_M)
