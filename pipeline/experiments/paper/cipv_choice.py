"""Experiment: is the closest in-path vehicle the right one? (paper, section CIPV, its four scenarios.)

Straight road, left turn, and two turns across the path, each with the LiDAR alone, the camera alone and both. The ego
vehicle follows its script, with a planned route for its GNSS, as in the paper. Truth is the nearest vehicle of which
0.9 m (or half of a narrower one) reach into a corridor along the path that the car will really drive. Within 0.3 m of
that limit either answer is right; where a nearer vehicle hides the lead there is no answer; and a lead that has just
come into sight must first be confirmed (``cipv.confirm_hits``). Such frames do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pipeline.common.near_face import near_face_middle
from pipeline.evaluation.lead_verdict import switches
from pipeline.evaluation.report_sections import AnyCell, Chart, Driven, ReportSection, Scene, Series, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.perception import GIVEN_SAID, SENSORS
from pipeline.experiments.true_lead import MAX_M, InSight, ScriptedWay, range_m, same_place, true_lead
from pipeline.params import CipvParams, Params
from pipeline.run import Sensors
from pipeline.simulation import scenario
from pipeline.simulation.closed_loop import LoopStep, Setup, drive
from pipeline.simulation.scenario import Scenario

SCENARIOS = {
    "straight": "straight road",
    "left_turn": "left turn",
    "turn_across_left": "turn across, from the left",
    "turn_across_right": "turn across, from the right",
}
_SHOWN_AT = 0.4
_MARGIN_M = 12.0
ChoiceKey = tuple[str, Sensors]
ChoiceVerdict = Literal["correct", "none", "missed", "false", "wrong", "edge", "hidden", "new"]
UNDECIDABLE = ("edge", "hidden", "new")
"""edge: either answer is correct · hidden: a nearer vehicle hides the lead · new: the lead came into sight, or the
drive began, too recently for confirmation."""


@dataclass(frozen=True)
class ChoiceCase:
    """One scene, driven once."""

    scene: str
    """One of the paper's four scenes."""
    sensors: Sensors
    """Sensors that the pipeline gets."""
    seed: int
    """Seed of noise and scenery."""

    @property
    def name(self) -> str:
        """Name for use in file names."""
        return f"choosing_{self.scene}_{SENSORS[self.sensors]}_{self.seed}".lower()


@dataclass(frozen=True)
class ChoiceFrame:
    """One frame's verdict."""

    t_s: float
    """Seconds since the start of the scenario."""
    verdict: ChoiceVerdict
    """Whether the CIPV was correct."""
    lead: int | None
    """Id of the true lead; None without one."""
    lead_m: float | None
    """Its true distance."""
    chosen: int | None
    """Id of the CIPV; None without one."""
    chosen_m: float | None
    """Its estimated distance."""


def cases(short: bool) -> list[ChoiceCase]:
    scenes = ("straight", "turn_across_left") if short else tuple(SCENARIOS)
    return [
        ChoiceCase(scene, sensors, seed) for scene in scenes for sensors in SENSORS for seed in range(1 if short else 5)
    ]


def run(case: ChoiceCase) -> list[ChoiceFrame]:
    scene = _scenario(case)
    setup = Setup(Params(), case.sensors, closed=False)
    way, in_sight, frames = ScriptedWay.of(scene), InSight(), []
    for tick in drive(scene, setup):
        assert tick.frame.camera is not None
        in_sight = in_sight.then(tick.world, tick.frame.camera)
        frame = judge(way, tick, in_sight)
        is_new = frame.verdict == "missed" and frame.lead is not None and not in_sight.is_confirmable(frame.lead)
        frames.append(replace(frame, verdict="new") if is_new else frame)
    return frames


def _scenario(case: ChoiceCase) -> Scenario:
    scene = scenario.load(case.scene)
    return scene.model_copy(update={"seed": scene.seed + 100 * case.seed})


def as_drive(case: ChoiceCase, frames: list[ChoiceFrame]) -> ExperimentDrive:
    """The drive of one run."""
    counted = sum(frame.verdict not in UNDECIDABLE for frame in frames)
    return ExperimentDrive(
        case.name,
        f"{SCENARIOS[case.scene].capitalize()}: {SENSORS[case.sensors]}, run {case.seed}",
        (f"Correct in {100.0 * _share_correct([frames]):.1f} % of {counted} decidable frames.",),
        _scenario(case),
        Params(),
        case.sensors,
        (_chart(case.scene, {(case.scene, case.sensors): [frames]}),),
    )


def judge(way: ScriptedWay, tick: LoopStep, in_sight: InSight) -> ChoiceFrame:
    """Compare the frame's CIPV with the vehicle that the car will really meet first."""
    lead, doubtful = true_lead(tick.world, way.ahead(tick.world))
    chosen = tick.result.chosen()
    if chosen is not None and (chosen.distance_m or 0.0) > MAX_M:
        chosen = None
    lead_m = range_m(lead) if lead is not None else None
    verdict: ChoiceVerdict
    if doubtful:
        verdict = "edge"
    elif lead is not None and in_sight.is_hidden(lead.actor.id):
        verdict = "hidden"
    elif lead is None:
        # a camera may underestimate the distance of a vehicle just beyond the limit
        beyond = chosen is not None and true_lead(tick.world, way.ahead(tick.world), MAX_M + _MARGIN_M)[0] is not None
        verdict = "none" if chosen is None else "edge" if beyond else "false"
    elif chosen is None or chosen.bev is None:
        verdict = "missed"
    else:
        verdict = "correct" if same_place(near_face_middle(chosen.bev), lead) else "wrong"
    return ChoiceFrame(
        tick.t_s,
        verdict,
        lead.actor.id if lead is not None else None,
        lead_m,
        chosen.id if chosen is not None else None,
        chosen.distance_m if chosen is not None else None,
    )


def acquired_m(frames: Sequence[ChoiceFrame]) -> list[float]:
    """For each true lead, its distance in the first frame in which it was correctly chosen."""
    first: dict[int, float] = {}
    for frame in frames:
        if frame.verdict == "correct" and frame.lead is not None and frame.lead_m is not None:
            first.setdefault(frame.lead, frame.lead_m)
    return list(first.values())


def report(cases: Sequence[ChoiceCase], runs: Sequence[list[ChoiceFrame]]) -> ReportSection:
    scenes = list(dict.fromkeys(case.scene for case in cases))
    driven: dict[ChoiceKey, dict[str, list[ChoiceFrame]]] = {
        (scene, sensors): {} for scene in scenes for sensors in SENSORS
    }
    for case, run in zip(cases, runs, strict=True):
        driven[case.scene, case.sensors][case.name] = run
    groups = {key: list(by_name.values()) for key, by_name in driven.items()}
    return ReportSection(
        "choosing",
        "Choosing the CIPV: straight, left turn, turns across",
        (
            "Correct: the right vehicle, or none if there is no lead. Missed: there is a lead, but none is chosen. "
            "False: one is chosen, but there is no lead. Wrong: another vehicle is chosen. New: the lead has been "
            f"visible for fewer frames than confirmation needs ({CipvParams().confirm_hits}) and is not chosen yet. "
            "Such frames do not count, nor do those in which the lead is hidden or at the edge of the path. The path "
            "is that of the route (the paper's was from a map), located by simulated RTK GNSS and fused with the yaw "
            "rate.",
            GIVEN_SAID,
            *(_verdict(scene, groups) for scene in scenes),
        ),
        (
            Table(
                "Frames",
                _COLUMNS,
                tuple(_row(scene, sensors, by_name) for (scene, sensors), by_name in driven.items()),
                "The share links to the worst run.",
                decimals=1,
            ),
        ),
        tuple(_chart(scene, groups) for scene in scenes),
        tuple(
            f"{SCENARIOS[scene].capitalize()}: fused is not correct in every decidable frame"
            for scene in scenes
            if groups[scene, "both"] and _share_correct(groups[scene, "both"]) < 1.0
        ),
        scenes=tuple(
            Scene(SCENARIOS[name].capitalize(), scene, _SHOWN_AT * scene.duration_s)
            for name in scenes
            for scene in (_scenario(ChoiceCase(name, "both", 0)),)
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


def _row(scene: str, sensors: Sensors, by_name: dict[str, list[ChoiceFrame]]) -> tuple[AnyCell, ...]:
    """The runs of one scenario with one set of sensors; the share links to the worst one."""
    runs = list(by_name.values())
    worst = min(by_name, key=lambda name: _share_correct([by_name[name]]), default="")
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


def _share_correct(runs: list[list[ChoiceFrame]]) -> float:
    frames = [frame for run in runs for frame in run if frame.verdict not in UNDECIDABLE]
    return sum(frame.verdict in ("correct", "none") for frame in frames) / max(len(frames), 1)


def _verdict(scene: str, groups: dict[ChoiceKey, list[list[ChoiceFrame]]]) -> str:
    share = {sensors: 100.0 * _share_correct(groups[scene, sensors]) for sensors in SENSORS}
    better = "better than" if share["both"] > share["lidar"] + 0.5 else "no better than"
    return (
        f"{SCENARIOS[scene].capitalize()}: fused is correct in {share['both']:.1f} % of the frames, {better} the LiDAR "
        f"alone ({share['lidar']:.1f} %); the camera alone {share['camera']:.1f} %."
    )


def _chart(scene: str, groups: dict[ChoiceKey, list[list[ChoiceFrame]]]) -> Chart:
    """Chart of the first run: the true lead's distance, and what each set of sensors chose."""
    first = {sensors: runs[0] for (name, sensors), runs in groups.items() if name == scene and runs}
    truth = [(frame.t_s, frame.lead_m) for frame in next(iter(first.values()), []) if frame.lead_m is not None]
    seen = (
        Series.of_points(
            SENSORS[sensors], ((frame.t_s, frame.chosen_m) for frame in frames if frame.chosen_m is not None)
        )
        for sensors, frames in first.items()
    )
    title = f"{SCENARIOS[scene].capitalize()}: distance of the CIPV"
    return Chart(title, "time s", "distance m", (Series.of_points("truth", truth), *seen))


CHOOSING = Experiment("choosing", "paper", "Choosing the CIPV", cases, run, report, as_drive)
