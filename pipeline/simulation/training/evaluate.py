"""How well a detector finds simulated vehicles, by distance.

``python -m pipeline.simulation.training.evaluate [MODEL] --count 400 --seed 2``
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from pipeline.geometry import iou_matrix
from pipeline.params import DetectionParams
from pipeline.simulation.camera import HEIGHT, WIDTH, calibration
from pipeline.simulation.scenario import names
from pipeline.simulation.training.labels import CLASSES, Label, labels
from pipeline.simulation.training.scenes import Moment, drive, moments
from pipeline.types import Detection
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.select import select

EDGES_M = (0.0, 10.0, 20.0, 30.0, 45.0, 60.0, 80.0, 100.0)
MATCH_IOU = 0.5
FREE_SHARE = 0.5
"""Vehicles less visible than this are neither asked for nor counted as wrong when found."""
_HEIGHT_M = 1.6


@dataclass
class Bin:
    """Counts of one range of distances. height_errors: found height over true height − 1, of boxes whole and clear."""

    vehicles: int = 0
    found: int = 0
    named: int = 0
    leads: int = 0
    leads_found: int = 0
    wrong: int = 0
    height_errors: list[float] = field(default_factory=list)

    def recall(self) -> float:
        return self.found / max(self.vehicles, 1)

    def lead_recall(self) -> float:
        return self.leads_found / max(self.leads, 1)

    def precision(self) -> float:
        return self.found / max(self.found + self.wrong, 1)

    def class_accuracy(self) -> float:
        return self.named / max(self.found, 1)

    def height_error(self) -> float:
        """Mean of the absolute relative error."""
        return float(np.mean(np.abs(self.height_errors))) if self.height_errors else 0.0


def evaluate(detector: Detector, pictures: Iterable[Moment], params: DetectionParams | None = None) -> list[Bin]:
    """One bin for each pair of ``EDGES_M``. A lead is the nearest vehicle straight ahead. A wrong detection has no
    distance; it counts where a car of its box's height would be."""
    camera = calibration()
    bins = [Bin() for _ in EDGES_M[1:]]
    for moment in pictures:
        detections = select(detector.detect(moment.picture), params or DetectionParams())
        _count(labels(moment.world, camera), detections, float(camera.K[1, 1]), bins)
    return bins


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("model", nargs="?", default="embedded")
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=2)
    options = parser.parse_args()
    detector = open_detector(options.model, (WIDTH, HEIGHT))
    _print(f"{options.count} random pictures", evaluate(detector, moments(options.seed, options.count)))
    for name in names():
        _print(f"scenario {name}", evaluate(detector, drive(name, 0.5)))


if __name__ == "__main__":
    main()
