"""Experiment: distance from box height, fitted in the scene (paper, Distance Estimation with Regression).

Three layouts, 20 runs each. Boxes are projected truth with a detector's errors. The law is fitted to the even runs of
the first layout and tested on everything else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from pipeline.common.geometry import closest_on_polygon, transform
from pipeline.evaluation.report_sections import Chart, ReportSection, Series, Table
from pipeline.experiments.experiment import Experiment, ExperimentDrive
from pipeline.experiments.paper.layouts import LAYOUTS, LayoutCase, cases, scenario, scenes
from pipeline.experiments.perception import GIVEN_SAID
from pipeline.experiments.straight_track import TARGET, true_range_m
from pipeline.params import DistanceParams, Params, preset
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.world import world_state
from pipeline.types import REAL_VEHICLES, CameraCalibration
from pipeline.vision.distance import PowerLaw, fit_power_law, height_at_reference, is_cut

_BINS_M = (5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0)


@dataclass(frozen=True)
class Sample:
    """One box with its ground truth."""

    height_px: float
    """Box height as seen by the reference camera."""
    depth_m: float
    """True distance along the optical axis."""
    range_m: float
    """True distance."""


def run(case: LayoutCase) -> list[Sample]:
    scene = scenario(case)
    camera = calibration(scene.camera)
    samples = []
    for index in range(scene.frame_count()):
        now = world_state.at(scene, index / scene.rate_hz)
        raw = truth_boxes.boxes(now, camera, BoxNoise(), case.seed, index)
        target = next(state for state in now.actors if state.actor.id == TARGET)
        for box in raw.boxes.tolist():
            if not is_cut(box, camera):
                height = height_at_reference(box, float(camera.K[1, 1]), DistanceParams())
                samples.append(Sample(height, _depth_m(target, camera), true_range_m(target)))
    return samples


def as_drive(case: LayoutCase, samples: list[Sample]) -> ExperimentDrive:
    """The drive of one run."""
    return ExperimentDrive(
        f"regression_{case.layout}_{case.seed}",
        f"Distance from box height: {LAYOUTS[case.layout]}, run {case.seed}",
        (f"{len(samples)} boxes.",),
        scenario(case),
        Params(),
        "camera",
        (Chart("Box height and depth", "box height px", "depth m", (_points(samples),)),),
    )


def _depth_m(target: world_state.ActorState, camera: CameraCalibration) -> float:
    x, y = closest_on_polygon(target.cuboid.footprint())
    return float(transform(camera.T_camera_ego, np.array([[x, y, target.cuboid.center[2]]]))[0, 2])


def report(cases: Sequence[LayoutCase], runs: Sequence[list[Sample]]) -> ReportSection:
    done = list(zip(cases, runs, strict=True))
    train = [each for case, run in done if case.layout == "a" and case.seed % 2 == 0 for each in run]
    free = fit_power_law([each.height_px for each in train], [each.depth_m for each in train])
    pinhole = fit_power_law([each.height_px for each in train], [each.depth_m for each in train], -1.0)
    judged = {
        layout: [
            each
            for case, run in done
            if case.layout == layout and not (layout == "a" and case.seed % 2 == 0)
            for each in run
        ]
        for layout in LAYOUTS
    }
    return ReportSection(
        "regression",
        "Distance from box height",
        (
            f"Fitted here: d = {free.coefficient:.1f} · h^{free.exponent:.3f}; with the pinhole exponent "
            f"{pinhole.coefficient:.1f} · h^−1. Printed: 1829.1 · h^−1.093. The law of YOLOX is fitted to real cars, "
            "which are 1.59 m tall; these are 1.48 m. Depth is along the optical axis. Boxes cut by the image's edge "
            "are left out.",
            GIVEN_SAID,
            "No comparison with the LiDAR: this experiment uses the camera's boxes only.",
        ),
        (
            _law_table(free, pinhole, judged),
            _error_table(pinhole, judged),
        ),
        (
            Chart(
                "Box height and depth", "box height px", "depth m", (_points(train), _curve(free), _curve(_printed()))
            ),
            Chart(
                "Mean error with the fitted law",
                "true range m",
                "mean error m",
                tuple(_by_bin(layout, samples, pinhole) for layout, samples in judged.items()),
            ),
        ),
        scenes=scenes(),
    )


@cache
def _printed() -> PowerLaw:
    paper = preset("paper").distance
    assert paper.coefficient is not None
    assert paper.exponent is not None
    return PowerLaw(paper.coefficient, paper.exponent)


def _law_table(free: PowerLaw, pinhole: PowerLaw, judged: dict[str, list[Sample]]) -> Table:
    own = truth_boxes.LAW
    laws = (
        ("printed, as range", _printed(), True),
        ("printed, as depth", _printed(), False),
        ("of YOLOX on real cars", PowerLaw(REAL_VEHICLES.coefficient, REAL_VEHICLES.exponent), False),
        ("used in these experiments", PowerLaw(own.coefficient, own.exponent), False),
        ("fitted, free exponent", free, False),
        ("fitted, exponent −1", pinhole, False),
    )
    rows = []
    for name, law, as_range in laws:
        errors = [_mean_error_share(samples, law, as_range) for samples in judged.values()]
        rows.append((name, law.coefficient, law.exponent, *errors))
    columns = ("law", "a", "b", *(f"{LAYOUTS[layout]} %" for layout in judged))
    return Table("Mean error, share of the distance", columns, tuple(rows), decimals=3)


def _mean_error_share(samples: list[Sample], law: PowerLaw, as_range: bool) -> float | None:
    if not samples:
        return None
    truth = np.array([each.range_m if as_range else each.depth_m for each in samples])
    return float(100.0 * np.mean(np.abs(_estimates(samples, law) / truth - 1.0)))


def _estimates(samples: list[Sample], law: PowerLaw) -> np.ndarray:
    return law.coefficient * np.array([each.height_px for each in samples]) ** law.exponent


def _error_table(law: PowerLaw, judged: dict[str, list[Sample]]) -> Table:
    rows = []
    for low, high in pairwise(_BINS_M):
        row: list[str | float | None] = [f"{low:.0f}–{high:.0f} m"]
        for samples in judged.values():
            inside = [each for each in samples if low <= each.range_m < high]
            errors = np.abs(_estimates(inside, law) - [each.depth_m for each in inside]) if inside else np.empty(0)
            row += [float(errors.mean()), float(errors.max())] if inside else [None, None]
        rows.append(tuple(row))
    columns = ("true range", *(f"{layout} {what} m" for layout in LAYOUTS.values() for what in ("mean", "max")))
    return Table("Error over distance with the fitted law", columns, tuple(rows), "One box at a time, not tracked.")


def _points(samples: list[Sample]) -> Series:
    return Series.of_points("boxes", ((each.height_px, each.depth_m) for each in samples))


def _curve(law: PowerLaw) -> Series:
    heights = tuple(float(h) for h in np.geomspace(18.0, 260.0, 60))
    return Series(f"{law.coefficient:.0f} · h^{law.exponent:.3f}", heights, tuple(law(h) for h in heights))


def _by_bin(layout: str, samples: list[Sample], law: PowerLaw) -> Series:
    middles, means = [], []
    for low, high in pairwise(_BINS_M):
        inside = [each for each in samples if low <= each.range_m < high]
        if inside:
            middles.append((low + high) / 2)
            means.append(float(np.abs(_estimates(inside, law) - [each.depth_m for each in inside]).mean()))
    return Series(LAYOUTS[layout], tuple(middles), tuple(means))


REGRESSION = Experiment("regression", "paper", "Distance from box height", cases, run, report, as_drive)
