"""The real recordings under changes, two thirds of them harsh: is the lead the same, does anything appear from nothing?

    CIPV_DATA=… python -m tests.soak.real_variants [--drives street,kitti,astyx] [--only mirrored,…] [--sensors camera]

Prints a row for each change and recording. Ends with 1 if, in a row, fewer than 98 % of the frames have the lead of
the unchanged recording after a change that must not matter, or if a lead nearer than 60 m or any braking appears on the
street without one. About 20 s a row.
"""

from __future__ import annotations

import argparse
import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from pipeline.common.geometry import iou_matrix
from pipeline.detection import Detectors, Detects, camera_of, far_lanes_for, lanes_for
from pipeline.evaluation.lead_verdict import LeadRule, judge
from pipeline.lanes.open_detector import usual_every
from pipeline.params import preset
from pipeline.run import Sensors, through
from pipeline.sources import open_source
from pipeline.types import U8, Frame, RawBoxes, Result
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import open_far_view
from tests.accuracy.drives import FOLDERS, SCHEMES, SCORED_CLIPS
from tests.soak.real_changes import HARSH, IMMATERIAL, Change, as_it_is

FAR_M, SAME_SHARE = 60.0, 0.98
_LEAST_SCORE, _OVERLAP = 0.2, 0.45
_UNDECIDED = 0.1
"""A vehicle whose probability of being in the path is this near to a half, as in the middle of a lane change."""
_SAME_M, _SAME_PART = 1.0, 0.1
"""Two distances of one vehicle differ by less than this, and this part of it."""


class EveryFifthMissing:
    """A detector that loses every fifth box: the strongest candidate and all that overlap it."""

    def __init__(self, detector: Detects[RawBoxes]) -> None:
        self._detector, self._count = detector, 0

    @property
    def name(self) -> str:
        return f"{self._detector.name}, every fifth box missing"

    @property
    def notes(self) -> tuple[str, ...]:
        return self._detector.notes

    def detect(self, bgr: U8) -> RawBoxes:
        found = self._detector.detect(bgr)
        sizes = np.column_stack([found.boxes[:, :2], found.boxes[:, 2:] - found.boxes[:, :2]])
        strongest = cv2.dnn.NMSBoxes(sizes.tolist(), found.scores.tolist(), _LEAST_SCORE, _OVERLAP)
        lost = [int(at) for n, at in enumerate(np.ravel(strongest)) if (self._count + n) % 5 == 4]
        self._count += len(strongest)
        if not lost:
            return found
        keep = iou_matrix(found.boxes, found.boxes[lost]).max(axis=1) < _OVERLAP
        labels = tuple(label for label, kept in zip(found.labels, keep, strict=True) if kept)
        far_count = int(keep[len(keep) - found.far_count :].sum()) if found.far_count else 0
        return replace(found, boxes=found.boxes[keep], scores=found.scores[keep], labels=labels, far_count=far_count)


class Row(NamedTuple):
    """A recording under a change."""

    frames: list[tuple[Frame, Result]]
    said: str
    """Its figures, in words."""
    wrong: bool
    """Whether there was a phantom."""


def run(folder: Path, kind: str, name: str, change: Change, sensors: Sensors) -> Row:
    """A recording of the data folder, with YOLOX-nano, its far view and TwinLiteNet."""
    source = open_source(f"{SCHEMES[kind]}:{folder / FOLDERS[kind]}")
    frames = [change(source.frame(index)) for index in range(len(source))]
    image = frames[0].image
    assert image is not None
    size = image.bgr.shape[1], image.bgr.shape[0]
    network = open_detector(str(folder / "models" / "yolox_nano.onnx"), size)
    boxes: Detects[RawBoxes] = network
    far = open_far_view(network, size)
    if name == "every fifth box missing":
        boxes = EveryFifthMissing(network)
        far = replace(far, detector=EveryFifthMissing(far.detector)) if far is not None else None
    lanes = lanes_for(source, "twinlitenet")
    every = usual_every(lanes, source.rate_hz)
    detectors = Detectors(boxes, lanes, every, far, far_lanes=far_lanes_for(camera_of(source), lanes))
    done = list(through(frames, preset("default"), detectors, sensors))
    said, wrong = _judged(kind, name, source, done)
    return Row(done, said, wrong)


def _judged(kind: str, name: str, source: object, done: list[tuple[Frame, Result]]) -> tuple[str, bool]:
    leads = {frame.name: result.cipv for frame, result in done if result.cipv is not None}
    if kind == "street":
        near = [lead for lead in leads.values() if lead.distance_m < FAR_M]
        braking = [result.acc for _, result in done if result.acc is not None and result.acc.brake > 0.0]
        return f"{len(near)} frames with a lead nearer than {FAR_M:g} m, {len(braking)} with braking", bool(
            near or braking
        )
    if kind == "kitti":
        return f"lead in {len(leads)} of {len(done)} frames, {len({lead.id for lead in leads.values()})} ids", False
    scored = {f"{number:06d}" for clip in SCORED_CLIPS.values() for number in clip}
    verdicts: Counter[str] = Counter()
    for frame, result in done:
        truth = source.truth(frame.index) if frame.name in scored else None  # type: ignore[attr-defined]
        if truth is not None and "mirrored" not in name:
            verdicts[judge(result, truth, LeadRule()).verdict] += 1
    return ", ".join(f"{count} {verdict}" for verdict, count in sorted(verdicts.items())) or "not judged", False


def same_share(one: Row, other: Row) -> float:
    """Share of the frames in which both have the same lead nearer than 60 m, or both have none. Frames in which the
    lead of ``one`` is as likely beside the path as in it are left out, as in the simulator's suites."""
    pairs = [(a, b) for (_, a), (_, b) in zip(one.frames, other.frames, strict=True) if _is_decided(a)]
    return sum(_is_same(a, b) for a, b in pairs) / len(pairs)


def _is_decided(result: Result) -> bool:
    lead = next((item for item in result.objects if result.cipv is not None and item.id == result.cipv.id), None)
    return lead is None or abs((lead.in_path_probability or 0.0) - 0.5) > _UNDECIDED


def _is_same(one: Result, other: Result) -> bool:
    a, b = (r.cipv.distance_m if r.cipv is not None and r.cipv.distance_m < FAR_M else None for r in (one, other))
    if a is None or b is None:
        return a is b
    return abs(a - b) < _SAME_M + _SAME_PART * min(a, b)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", default="street,kitti,astyx")
    parser.add_argument("--only", default="")
    parser.add_argument("--sensors", default="both", choices=["both", "camera", "lidar"])
    asked = parser.parse_args()
    folder = Path(os.environ["CIPV_DATA"])
    changes = {name: change for name, change in (IMMATERIAL | HARSH).items() if name in asked.only or not asked.only}
    failed = False
    for kind in asked.drives.split(","):
        plain = run(folder, kind, "", as_it_is, asked.sensors)
        print(f"{kind:7} {'unchanged':31} {plain.said}", flush=True)
        for name, change in changes.items():
            row = run(folder, kind, name, change, asked.sensors)
            share = same_share(plain, row)
            bad = row.wrong or (name in IMMATERIAL and share < SAME_SHARE)
            failed |= bad
            print(f"{kind:7} {name:31} {row.said}; same lead {share:.0%}{'  ← WRONG' if bad else ''}", flush=True)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
