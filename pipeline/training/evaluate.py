"""How well a detector finds simulated vehicles, by distance.

``python -m pipeline.training.evaluate [MODEL] --count 100 --seeds 101 202 303``
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np
from scipy.stats import binomtest

from pipeline.common.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.simulation.built_in import names
from pipeline.simulation.sensors.camera import HEIGHT, WIDTH, calibration
from pipeline.training.labels import CLASSES, Label, labels
from pipeline.training.scenes import DrawnScene, drive, moments
from pipeline.types import Detection
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.nms import select

EDGES_M = (0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 100.0)
MATCH_IOU = 0.5
JUDGE_SEEDS = (101, 202, 303, 404, 505, 606, 707)
"""Random traffic not used for training or the distance law."""
FREE_SHARE = 0.5
"""A vehicle with a smaller visible share does not count as missed, nor its box as a false positive."""
LEAD_M = 60.0
"""Maximum distance of a scored lead."""
_HEIGHT_M = 1.6


@dataclass
class Bin:
    """Counts of one range of distances."""

    vehicles: int = 0
    """Number of vehicles in the images."""
    found: int = 0
    """Of these, how many have a box."""
    named: int = 0
    """Of those found, how many have the right class."""
    leads: int = 0
    """Number of leads, each the nearest vehicle straight ahead in an image."""
    leads_found: int = 0
    """Of these, how many have a box."""
    wrong: int = 0
    """Number of false positives."""
    height_errors: list[float] = field(default_factory=list)
    """Detected height / true height − 1 of each uncut, unoccluded vehicle that was found."""

    def recall(self) -> float:
        return self.found / max(self.vehicles, 1)

    def lead_recall(self) -> float:
        return self.leads_found / max(self.leads, 1)

    def lead_interval(self) -> tuple[float, float]:
        """95 % confidence interval of the lead's recall (Wilson 1927)."""
        interval = binomtest(self.leads_found, self.leads).proportion_ci(method="wilson")
        return float(interval.low), float(interval.high)

    def precision(self) -> float:
        return self.found / max(self.found + self.wrong, 1)

    def class_accuracy(self) -> float:
        return self.named / max(self.found, 1)

    def height_error(self) -> float:
        """Mean of the absolute relative error."""
        return float(np.mean(np.abs(self.height_errors))) if self.height_errors else 0.0


def evaluate(detector: Detector, images: Iterable[DrawnScene], params: DetectionParams | None = None) -> list[Bin]:
    """One bin for each pair of ``EDGES_M``. A lead is the nearest vehicle straight ahead. A false positive has no
    distance; it counts at the distance of a car with its box height."""
    camera = calibration()
    bins = [Bin() for _ in EDGES_M[1:]]
    for moment in images:
        detections = select(detector.detect(moment.image), params or DetectionParams())
        _count(labels(moment.world, camera), detections, float(camera.K[1, 1]), bins)
    return bins


def within(bins: list[Bin], far_m: float) -> Bin:
    """The sum of all bins up to ``far_m``."""
    return _sum(part for part, end_m in zip(bins, EDGES_M[1:], strict=True) if end_m <= far_m)


def pooled(runs: Iterable[list[Bin]]) -> list[Bin]:
    """The sum of several evaluations, bin by bin."""
    return [_sum(parts) for parts in zip(*runs, strict=True)]


def _sum(bins: Iterable[Bin]) -> Bin:
    """One bin with the sum of every count."""
    return Bin(*(reduce(add, counts) for counts in zip(*(vars(part).values() for part in bins), strict=True)))


def _count(truth: tuple[Label, ...], detections: tuple[Detection, ...], focal_px: float, bins: list[Bin]) -> None:
    boxes = np.array([label.box for label in truth]).reshape(-1, 4)
    found = np.array([detection.bbox for detection in detections]).reshape(-1, 4)
    overlap = iou_matrix(boxes, found)
    lead = next((label for label in truth if label.ahead), None)
    for label, row in zip(truth, overlap, strict=True):
        place = _bin(label.distance_m, bins)
        if place is None or label.visible < FREE_SHARE:
            continue
        best = int(np.argmax(row)) if len(row) else -1
        hit = best >= 0 and bool(row[best] >= MATCH_IOU)
        place.vehicles += 1
        place.found += hit
        place.leads += label is lead
        place.leads_found += hit and label is lead
        if hit:
            place.named += detections[best].label == CLASSES[label.label]
            if not label.cut:
                box, seen = label.box, detections[best].bbox
                place.height_errors.append((seen[3] - seen[1]) / (box[3] - box[1]) - 1.0)
    for detection, column in zip(detections, overlap.T, strict=True):
        place = _bin(focal_px * _HEIGHT_M / max(detection.bbox[3] - detection.bbox[1], 1.0), bins)
        if place is not None and (not len(column) or column.max() < MATCH_IOU):
            place.wrong += 1


def _bin(distance_m: float, bins: list[Bin]) -> Bin | None:
    index = int(np.searchsorted(EDGES_M, distance_m, side="right")) - 1
    return bins[index] if 0 <= index < len(bins) else None


def _print(title: str, bins: list[Bin]) -> None:
    print(f"\n{title}\n  distance m  vehicles  recall  leads  recall  precision  class  height error")
    for (low, high), part in zip(itertools.pairwise(EDGES_M), bins, strict=True):
        print(
            f"  {low:4.0f} – {high:3.0f} {part.vehicles:9d} {100 * part.recall():6.1f}% {part.leads:6d}"
            f" {100 * part.lead_recall():6.1f}% {100 * part.precision():9.1f}% {100 * part.class_accuracy():5.1f}%"
            f" {100 * part.height_error():10.1f}%"
        )
    near = within(bins, LEAD_M)
    if near.leads:
        low, high = near.lead_interval()
        print(
            f"  lead within {LEAD_M:.0f} m: {near.leads_found} of {near.leads}, {100 * near.lead_recall():.1f} % "
            f"(95 %: {100 * low:.1f}–{100 * high:.1f} %); all vehicles {100 * near.recall():.1f} %, "
            f"precision {100 * near.precision():.1f} %"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?", default="embedded")
    parser.add_argument("--count", type=int, default=100, help="images of each seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=JUDGE_SEEDS)
    options = parser.parse_args()
    detector = open_detector(options.model, (WIDTH, HEIGHT))
    of_seeds = {seed: evaluate(detector, moments(seed, options.count)) for seed in options.seeds}
    for seed, bins in of_seeds.items():
        near = within(bins, LEAD_M)
        print(f"seed {seed}: lead within {LEAD_M:.0f} m {near.leads_found} of {near.leads}")
    _print(f"{options.count} random images of each seed", pooled(of_seeds.values()))
    of_scenarios = {name: evaluate(detector, drive(name, 1.0)) for name in names()}
    for name, bins in of_scenarios.items():
        _print(f"scenario {name}", bins)
    _print(f"all {len(of_scenarios)} scenarios", pooled(of_scenarios.values()))


if __name__ == "__main__":
    main()
