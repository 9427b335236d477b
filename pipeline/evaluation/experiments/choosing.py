"""Experiment: is the closest in-path vehicle the right one? (paper, section CIPV, its four scenarios.)

Straight road, left turn, and two turns across the path, each with the LiDAR alone, the camera alone and both. The ego
vehicle follows its script, and GNSS knows the road that it means to drive, as the paper's did. Truth is the way that it
will really drive: the nearest vehicle of which 0.9 m (half of what is narrower) reach into a corridor along it. Within
0.3 m of that edge either answer is right, where a nearer vehicle hides the lead nobody can say, and a lead that has
just come into sight must be seen as often as confirmation asks (``cipv.confirm_hits``): such frames do not count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from pipeline.evaluation.experiments.sections import (
    GIVEN_SAID,
    AnyCell,
    Chart,
    Driven,
    Experiment,
    Replay,
    Scene,
    Section,
    Series,
    Table,
)
from pipeline.evaluation.lead import switches
from pipeline.params import CipvParams, Params, PathParams
from pipeline.path.corridor import nearest_on_path
from pipeline.path.placing import near_face_middle
from pipeline.run import Sensors
from pipeline.simulation import scenario, world
from pipeline.simulation.loop import Setup, Tick, drive
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.truth_boxes import in_picture
from pipeline.simulation.world import ActorState, World
from pipeline.types import F64, CameraCalibration, Path, Point2

SCENARIOS = {
    "straight": "straight road",
    "left_turn": "left turn",
    "turn_across_left": "turn across, from the left",
    "turn_across_right": "turn across, from the right",
}
SENSORS: dict[Sensors, str] = {"lidar": "LiDAR", "camera": "camera", "both": "fused"}
MAX_M = 60.0
OVERLAP_M = 0.9
"""In the path: as much of the vehicle as this reaches into the corridor, or half of what is narrower."""
VISIBLE_SHARE = 0.35
_SHOWN_AT = 0.4
_EDGE_M, _MARGIN_M = 0.3, 12.0
_AHEAD_M, _STEP_S, _LONGEST_S, _SMALLEST_MOVE_M = 90.0, 0.25, 15.0, 0.2
_SAME_PLACE_M, _SAME_SHARE = 2.5, 0.2
Verdict = Literal["correct", "none", "missed", "false", "wrong", "edge", "hidden", "new"]
UNDECIDABLE = ("edge", "hidden", "new")
"""edge: either answer is right · hidden: a nearer vehicle covers the lead · new: it was covered, or the drive had not
begun, so short a time ago that it cannot be confirmed yet."""


@dataclass(frozen=True)
class Case:
    scene: str
    sensors: Sensors
    seed: int

    @property
    def name(self) -> str:
        """Fit for a file."""
        return f"choosing_{self.scene}_{SENSORS[self.sensors]}_{self.seed}".lower()


@dataclass(frozen=True)
class Frame:
    """One frame's verdict, with the true lead's id and range and the chosen object's id; null where there is none."""

    t_s: float
    verdict: Verdict
    lead: int | None
    lead_m: float | None
    chosen: int | None
    chosen_m: float | None


def cases(short: bool) -> list[Case]:
    scenes = ("straight", "turn_across_left") if short else tuple(SCENARIOS)
    return [Case(scene, sensors, seed) for scene in scenes for sensors in SENSORS for seed in range(1 if short else 5)]


def run(case: Case) -> list[Frame]:
    scene = _scenario(case)
    setup = Setup(Params(), case.sensors, closed=False)
    way, in_sight, frames = Way.of(scene), InSight(), []
    for tick in drive(scene, setup):
        assert tick.frame.camera is not None
        in_sight = in_sight.then(tick.world, tick.frame.camera)
        frame = judge(way, tick, in_sight)
        is_new = frame.verdict == "missed" and frame.lead is not None and not in_sight.is_confirmable(frame.lead)
        frames.append(replace(frame, verdict="new") if is_new else frame)
    return frames


def _scenario(case: Case) -> Scenario:
    scene = scenario.load(case.scene)
    return scene.model_copy(update={"seed": scene.seed + 100 * case.seed})


def replay(case: Case, frames: list[Frame]) -> Replay:
    """The drive of one run."""
    counted = sum(frame.verdict not in UNDECIDABLE for frame in frames)
    return Replay(
        case.name,
        f"{SCENARIOS[case.scene].capitalize()}: {SENSORS[case.sensors]}, run {case.seed}",
        (f"Right in {100.0 * _share_correct([frames]):.1f} % of {counted} decidable frames.",),
        _scenario(case),
        Params(),
        case.sensors,
        (_chart(case.scene, {(case.scene, case.sensors): [frames]}),),
    )


def judge(way: Way, tick: Tick, in_sight: InSight) -> Frame:
    """The frame's CIPV against the vehicle that the car will really meet first."""
    lead, doubtful = true_lead(tick.world, way.ahead(tick.world))
    cipv = tick.result.cipv
    chosen = next((item for item in tick.result.objects if cipv is not None and item.id == cipv.id), None)
    if chosen is not None and (chosen.distance_m or 0.0) > MAX_M:
        chosen = None
    lead_m = _range_m(lead) if lead is not None else None
    verdict: Verdict
    if doubtful:
        verdict = "edge"
    elif lead is not None and in_sight.is_hidden(lead.actor.id):
        verdict = "hidden"
    elif lead is None:
        # what drives only just too far ahead a camera may take for less
        beyond = chosen is not None and true_lead(tick.world, way.ahead(tick.world), MAX_M + _MARGIN_M)[0] is not None
        verdict = "none" if chosen is None else "edge" if beyond else "false"
    elif chosen is None or chosen.bev is None:
        verdict = "missed"
    else:
        verdict = "correct" if same_place(near_face_middle(chosen.bev), lead) else "wrong"
    return Frame(
        tick.t_s,
        verdict,
        lead.actor.id if lead is not None else None,
        lead_m,
        chosen.id if chosen is not None else None,
        chosen.distance_m if chosen is not None else None,
    )


@dataclass(frozen=True)
class Way:
    """Where the ego vehicle's script takes it. t_s: (M,). places: (M, 2) world x, y."""

    t_s: F64
    places: F64

    @staticmethod
    def of(scene: Scenario) -> Way:
        """The whole drive and 15 s more."""
        alone = scene.model_copy(update={"actors": (), "crossing_actors": ()})
        t_s = np.arange(0.0, scene.duration_s + _LONGEST_S, _STEP_S)
        return Way(t_s, np.array([world.at(alone, float(t)).pose[:2] for t in t_s]))

    def ahead(self, now: World, at_most_m: float = _AHEAD_M) -> Path | None:
        """What is left of it, 90 m at most, in the ego frame of now; null while the car stands."""
        coming = np.vstack([now.pose[:2], self.places[self.t_s > now.t_s]])
        moved = np.hypot(*np.diff(coming, axis=0).T)
        keep = np.concatenate([[True], (moved > _SMALLEST_MOVE_M) & (np.cumsum(moved) < at_most_m)])
        if keep.sum() < 2:
            return None
        center = now.to_ego(coming[keep])
        return Path("gnss", center, center, center, PathParams().half_width_m, {}, {})


def true_lead(now: World, path: Path | None, max_m: float = MAX_M) -> tuple[ActorState | None, bool]:
    """The first vehicle on the driven path within ``max_m``, and whether one at the path's edge makes that doubtful."""
    found: list[tuple[float, ActorState]] = []
    doubtful_m = np.inf
    for state in now.actors:
        if path is None or _range_m(state) > max_m:
            continue
        offsets, along = nearest_on_path(path, state.cuboid.footprint())
        low, high, nearest = float(offsets.min()), float(offsets.max()), float(along.min())
        if nearest <= 0.0:
            continue
        half = path.half_width_m
        too_little = min(high, half) - max(low, -half) - min(OVERLAP_M, 0.5 * (high - low))
        if abs(too_little) < _EDGE_M:
            doubtful_m = min(doubtful_m, nearest)
        elif too_little > 0.0:
            found.append((nearest, state))
    nearest_m, lead = min(found, key=lambda pair: pair[0], default=(np.inf, None))
    return lead, bool(doubtful_m < nearest_m)


@dataclass(frozen=True)
class InSight:
    """For how many frames in a row each vehicle has been in sight, by number. A hidden one is not among them."""

    frames: Mapping[int, int] = field(default_factory=dict)

    def then(self, now: World, camera: CameraCalibration) -> InSight:
        """One frame later."""
        covered = _covered(now, camera)
        ids = [state.actor.id for state in now.actors if state.actor.id not in covered]
        return InSight({each: self.frames.get(each, 0) + 1 for each in ids})

    def is_hidden(self, actor: int) -> bool:
        """Whether nearer vehicles cover so much of it that neither sensor can see it."""
        return actor not in self.frames

    def is_confirmable(self, actor: int) -> bool:
        """Whether it could have been seen as often as an object must be that one sensor sees."""
        return self.frames.get(actor, 0) >= CipvParams().confirm_hits


def _covered(now: World, camera: CameraCalibration) -> frozenset[int]:
    return frozenset(seen.actor.actor.id for seen in in_picture(now, camera) if seen.visible < VISIBLE_SHARE)


def _near_face(state: ActorState) -> Point2:
    a, b, c, d = ((float(x), float(y)) for x, y in state.cuboid.footprint())
    return near_face_middle((a, b, c, d))


def _range_m(state: ActorState) -> float:
    return float(np.hypot(*_near_face(state)))


def same_place(point: Point2, lead: ActorState) -> bool:
    """Whether a point is where a vehicle's nearest face is, give or take a fifth of its range."""
    x, y = _near_face(lead)
    return float(np.hypot(point[0] - x, point[1] - y)) <= max(_SAME_PLACE_M, _SAME_SHARE * _range_m(lead))


def acquired_m(frames: Sequence[Frame]) -> list[float]:
    """For each true lead: its range in the first frame in which it was rightly chosen."""
    first: dict[int, float] = {}
    for frame in frames:
        if frame.verdict == "correct" and frame.lead is not None and frame.lead_m is not None:
            first.setdefault(frame.lead, frame.lead_m)
    return list(first.values())


def report(cases: Sequence[Case], runs: Sequence[list[Frame]]) -> Section:
    scenes = list(dict.fromkeys(case.scene for case in cases))
    by_name = {case.name: _share_correct([run]) for case, run in zip(cases, runs, strict=True)}
    groups = {
        (scene, sensors): [
            run for case, run in zip(cases, runs, strict=True) if (case.scene, case.sensors) == (scene, sensors)
        ]
        for scene in scenes
        for sensors in SENSORS
    }
    worst = {
        (scene, sensors): min(
            (case.name for case in cases if (case.scene, case.sensors) == (scene, sensors)),
            key=lambda name: by_name[name],
            default="",
        )
        for scene, sensors in groups
    }
    return Section(
        "choosing",
        "Choosing the CIPV: straight, left turn, turns across",
        (
            "Correct: the right vehicle, or rightly none. Missed: there is one, none is chosen. False: there is none, "
            "one is chosen. Wrong: another one is chosen. New: the lead came into sight fewer frames ago than "
            f"confirmation asks ({CipvParams().confirm_hits}), and is not chosen yet. Such frames are not among those "
            "counted, nor are those in which it is hidden or at the edge of the path. The path is the route's, as the "
            "paper's was a map's, placed by simulated RTK GNSS, fused with the yaw rate.",
            GIVEN_SAID,
            *(_verdict(scene, groups) for scene in scenes),
        ),
        (
            Table(
                "Frames",
                _COLUMNS,
                tuple(_row(scene, sensors, group, worst[scene, sensors]) for (scene, sensors), group in groups.items()),
                "The share leads to the run with the least.",
                decimals=1,
            ),
        ),
        tuple(_chart(scene, groups) for scene in scenes),
        tuple(
            f"{SCENARIOS[scene].capitalize()}: fused is not right in every decidable frame"
            for scene in scenes
            if groups[scene, "both"] and _share_correct(groups[scene, "both"]) < 1.0
        ),
        scenes=tuple(
            Scene(SCENARIOS[name].capitalize(), scene, _SHOWN_AT * scene.duration_s)
            for name in scenes
            for scene in (_scenario(Case(name, "both", 0)),)
        ),
    )


_COLUMNS = (
    "scenario",
    "sensors",
    "frames",
    "correct %",
    "missed",
    "false",
    "wrong",
    "with a lead",
    "first acquired at m",
    "switches a run",
    "new",
)


def _row(scene: str, sensors: Sensors, runs: list[list[Frame]], worst: str) -> tuple[AnyCell, ...]:
    frames = [frame for run in runs for frame in run if frame.verdict not in UNDECIDABLE]
    count = {verdict: sum(frame.verdict == verdict for frame in frames) for verdict in ("missed", "false", "wrong")}
    first = [distance for run in runs for distance in acquired_m(run)]
    return (
        SCENARIOS[scene],
        SENSORS[sensors],
        len(frames),
        Driven(100.0 * _share_correct(runs), worst),
        *count.values(),
        sum(frame.lead is not None for frame in frames),
        sum(first) / len(first) if first else None,
        sum(switches((frame.lead, frame.chosen) for frame in run) for run in runs) / len(runs) if runs else None,
        sum(frame.verdict == "new" for run in runs for frame in run),
    )


def _share_correct(runs: list[list[Frame]]) -> float:
    frames = [frame for run in runs for frame in run if frame.verdict not in UNDECIDABLE]
    return sum(frame.verdict in ("correct", "none") for frame in frames) / max(len(frames), 1)


def _verdict(scene: str, groups: dict[tuple[str, Sensors], list[list[Frame]]]) -> str:
    share = {sensors: 100.0 * _share_correct(groups[scene, sensors]) for sensors in SENSORS}
    better = "better than" if share["both"] > share["lidar"] + 0.5 else "no better than"
    return (
        f"{SCENARIOS[scene].capitalize()}: fused is right in {share['both']:.1f} % of the frames, {better} the LiDAR "
        f"alone ({share['lidar']:.1f} %); the camera alone {share['camera']:.1f} %."
    )


def _chart(scene: str, groups: dict[tuple[str, Sensors], list[list[Frame]]]) -> Chart:
    """The first run: the true lead's range and what each set of sensors chose."""
    first = {sensors: runs[0] for (name, sensors), runs in groups.items() if name == scene and runs}
    truth = [(frame.t_s, frame.lead_m) for frame in next(iter(first.values()), []) if frame.lead_m is not None]
    lines = [Series("truth", tuple(t for t, _ in truth), tuple(d for _, d in truth), points_only=True)]
    for sensors, frames in first.items():
        seen = [(frame.t_s, frame.chosen_m) for frame in frames if frame.chosen_m is not None]
        lines.append(Series(SENSORS[sensors], tuple(t for t, _ in seen), tuple(d for _, d in seen), points_only=True))
    return Chart(f"{SCENARIOS[scene].capitalize()}: distance of the CIPV", "time s", "distance m", tuple(lines))


CHOOSING = Experiment("choosing", "paper", "Choosing the CIPV", cases, run, report, replay)
