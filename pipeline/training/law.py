"""The distance law of a detector of simulated vehicles, fitted to images it was not trained on, and its errors.

``python -m pipeline.training.law [MODEL]`` prints both and saves the law next to the network.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.calibration.distance import MIN_DEPTH_M, Pair, as_law, fit_laws
from pipeline.common.geometry import closest_on_polygon, iou_matrix, transform
from pipeline.inference.distance_laws import keep_law
from pipeline.inference.model_registry import EMBEDDED
from pipeline.params import DetectionParams, DistanceParams
from pipeline.simulation.built_in import names
from pipeline.simulation.sensors.camera import HEIGHT, WIDTH, calibration
from pipeline.training.evaluate import EDGES_M, JUDGE_SEEDS, MATCH_IOU
from pipeline.training.labels import labels
from pipeline.training.scenes import DrawnScene, drive, moments
from pipeline.types import DistanceLaw
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.distance import height_at_reference, is_cut
from pipeline.vision.nms import select

FIT_SEEDS = (7, 8, 9)
"""Seeds not used for training or evaluation; each gives other roads, traffic and vehicle sizes."""
_JUDGE_COUNT = 100
MAX_DEPTH_M = 60.0
"""Beyond this, a network mainly finds the taller ones of similar cars, so a law fitted to those would overestimate
distances."""
CLEAR_SHARE = 0.9
"""If less of a vehicle is visible, its box has only the height of the visible part."""


@dataclass(frozen=True)
class SeenPair(Pair):
    """kind: the kind of vehicle, which may differ from the label: a van is a "car"."""

    kind: str
    """The kind of vehicle, which may differ from the label: a van is a "car"."""


def pairs(detector: Detector, images: Iterable[DrawnScene]) -> Iterator[SeenPair]:
    """Yield the box of every uncut, unoccluded vehicle with the true depth of its nearest point."""
    camera = calibration()
    for number, moment in enumerate(images):
        detections = select(detector.detect(moment.image), DetectionParams())
        truth = labels(moment.world, camera)
        if not detections or not truth:
            continue
        states = {state.actor.id: state for state in moment.world.actors}
        overlap = iou_matrix(np.array([each.box for each in truth]), np.array([each.bbox for each in detections]))
        for row, label in enumerate(truth):
            column = int(overlap[row].argmax())
            box = detections[column].bbox
            mine = int(overlap[:, column].argmax()) == row and overlap[row, column] >= MATCH_IOU
            if not mine or label.cut or label.visible < CLEAR_SHARE or is_cut(box, camera):
                continue
            state = states[label.actor_id]
            x, y = closest_on_polygon(state.cuboid.footprint())
            depth_m = float(transform(camera.T_camera_ego, np.array([[x, y, state.cuboid.center[2]]]))[0, 2])
            if depth_m >= MIN_DEPTH_M:
                height_px = height_at_reference(box, float(camera.K[1, 1]), DistanceParams())
                range_m = float(np.hypot(x, y))
                yield SeenPair(str(number), detections[column].label, height_px, depth_m, range_m, state.actor.kind)


def fit(found: Iterable[SeenPair]) -> DistanceLaw:
    """Fit the law of a pinhole camera, b = −1. Vans are excluded from the law of cars: they are a third taller, so a
    law in between would be wrong for both."""
    near = [pair for pair in found if pair.depth_m <= MAX_DEPTH_M and (pair.label, pair.kind) != ("car", "van")]
    return as_law(fit_laws(near, -1.0), DistanceParams().reference_focal_px)


def errors(found: Iterable[SeenPair], law: DistanceLaw) -> list[tuple[int, float, float]]:
    """Errors for cars, for each pair of ``EDGES_M``: number of cars, mean and mean absolute error, relative to the true
    depth."""
    cars = [pair for pair in found if pair.label == pair.kind == "car"]
    rows = []
    for low, high in itertools.pairwise(EDGES_M):
        share = np.array(
            [
                law.coefficient * pair.height_px**law.exponent / pair.depth_m - 1.0
                for pair in cars
                if low <= pair.depth_m < high
            ]
        )
        rows.append((len(share), float(share.mean()), float(np.abs(share).mean())) if len(share) else (0, 0.0, 0.0))
    return rows


def _scenario_images() -> Iterator[DrawnScene]:
    return itertools.chain.from_iterable(drive(name, 1.0) for name in names())


def _rows(found: Iterable[SeenPair], law: DistanceLaw) -> list[str]:
    """``errors`` as text."""
    return [
        f"{low:.0f}–{high:.0f} m: {count} cars, mean error {100 * mean:+.1f} %, mean absolute {100 * absolute:.1f} %"
        for (low, high), (count, mean, absolute) in zip(itertools.pairwise(EDGES_M), errors(found, law), strict=True)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?", default=EMBEDDED)
    parser.add_argument("--count", type=int, default=120, help="images of each seed to fit to")
    parser.add_argument("--dry", action="store_true", help="keep nothing")
    options = parser.parse_args()
    detector = open_detector(options.model, (WIDTH, HEIGHT))
    seen = [pair for seed in FIT_SEEDS for pair in pairs(detector, moments(seed, options.count))]
    law = fit(seen)
    print(law)
    judged = {
        "random traffic": [pair for seed in JUDGE_SEEDS for pair in pairs(detector, moments(seed, _JUDGE_COUNT))],
        "built-in scenarios": list(pairs(detector, _scenario_images())),
    }
    rows = {title: _rows(found, law) for title, found in judged.items()}
    for title, lines in rows.items():
        print(title, *lines, sep="\n  ")
    if not options.dry:
        what = f"{len(seen)} clear vehicles in {options.count} random images of each of the seeds {FIT_SEEDS}"
        print(keep_law(detector.path, law, {"to": what, "cars": rows}))


if __name__ == "__main__":
    main()
