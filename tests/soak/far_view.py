"""What each detector finds in each view, by distance: the whole image, the far view, and both.

    python -m tests.soak.far_view

Each Astyx frame of ``CIPV_DATA`` is processed on its own. A labelled vehicle within ``ASIDE_M`` of the car's axis is
found if a vehicle's box overlaps the projection of its cuboid by more than ``SAME_IOU``. Prints one table row per
detector and view: recall by ten metres of distance, vehicle boxes per frame that match no label, processor time.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.alignment.projection import Alignment, project_cuboid, resolve
from pipeline.common.files.data_dir import data_dir
from pipeline.common.geometry import F64, iou_matrix
from pipeline.detection import Detectors, detect
from pipeline.inference.model_registry import EMBEDDED
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import U8, VEHICLES, Frame
from pipeline.types.source import TruthObject
from pipeline.vision import nms
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import open_far_view

ASIDE_M, SAME_IOU = 1.8, 0.4
STEP_M, STEPS = 10.0, 10
RECORDINGS = ("astyx", "astyx_more")


@dataclass
class Found:
    """Counts of one detector in one view."""

    labelled: list[int] = field(default_factory=lambda: [0] * STEPS)
    """Vehicles in the path, by ten metres."""
    found: list[int] = field(default_factory=lambda: [0] * STEPS)
    """Those with a box."""
    unmatched: int = 0
    """Vehicle boxes without a labelled vehicle."""
    frames: int = 0
    cpu_s: float = 0.0

    def add(self, boxes: F64, drawn: F64, distances_m: F64, is_in_path: F64) -> None:
        """Count one frame. boxes (M, 4); drawn (N, 4): the labelled vehicles in the image, with their distances."""
        overlap = iou_matrix(boxes, drawn)
        self.unmatched += int((overlap.max(axis=1, initial=0.0) <= SAME_IOU).sum())
        self.frames += 1
        for distance_m, counts, best in zip(distances_m, is_in_path, overlap.max(axis=0, initial=0.0), strict=True):
            at = int(distance_m // STEP_M)
            if counts and at < STEPS:
                self.labelled[at] += 1
                self.found[at] += bool(best > SAME_IOU)

    def row(self) -> list[str]:
        """Recall in percent by ten metres, then unmatched boxes per frame, then processor time in ms."""
        shares = [
            f"{100 * hit / all_:.0f}" if all_ else "–" for hit, all_ in zip(self.found, self.labelled, strict=True)
        ]
        return [*shares, f"{self.unmatched / self.frames:.1f}", f"{1e3 * self.cpu_s / self.frames:.0f}"]


def labelled(truth: tuple[TruthObject, ...] | None, aligned: Alignment, image: U8) -> tuple[F64, F64, F64]:
    """The labelled vehicles in an image: their boxes (N, 4), distances (N,), and whether they are in the path (N,)."""
    height, width = image.shape[:2]
    rows = []
    for item in truth or ():
        corners = item.cuboid.corners()
        box = project_cuboid(aligned, corners, width, height) if item.label in VEHICLES else None
        if box is not None:
            distance_m = float(np.hypot(corners[:, 0], corners[:, 1]).min())
            rows.append((*box, distance_m, abs(item.cuboid.center[1]) < ASIDE_M))
    table = np.array(rows, dtype=np.float64).reshape(-1, 6)
    return table[:, :4], table[:, 4], table[:, 5]


def views_of(spec: str, size: tuple[int, int]) -> Iterator[tuple[str, Detectors]]:
    """The views of a detector for images of a size, without those that it does not have."""
    network = open_detector(spec, size)
    far = open_far_view(network, size)
    yield "whole", Detectors(network)
    if far is not None:
        yield "far", Detectors(far=far)
        yield "both", Detectors(network, far=far)


def look(frame: Frame, truth: tuple[TruthObject, ...] | None, detectors: Detectors, counts: Found) -> None:
    """Run detectors on a frame and count what they find."""
    params = Params()
    aligned = resolve(params.alignment, frame.camera)
    assert frame.image is not None
    assert aligned is not None
    before = time.process_time()
    seen = detect(frame, detectors).raw_boxes
    counts.cpu_s += time.process_time() - before
    assert seen is not None
    found = nms.select(seen, params.detection)
    boxes = np.array([each.bbox for each in found if each.label in VEHICLES], dtype=np.float64).reshape(-1, 4)
    counts.add(boxes, *labelled(truth, aligned, frame.image.bgr))


def main() -> None:
    models = data_dir() / "models"
    counts: dict[tuple[str, str], Found] = {}
    for recording in RECORDINGS:
        source = open_source(f"astyx:{data_dir() / recording}")
        detectors: dict[tuple[str, str], Detectors] = {}
        for index in range(len(source)):
            frame = source.frame(index)
            assert frame.image is not None
            height, width = frame.image.bgr.shape[:2]
            if not detectors:
                for spec in (str(models / "yolox_nano.onnx"), str(models / "deimv2_femto.onnx"), EMBEDDED):
                    for view, each in views_of(spec, (width, height)):
                        detectors[Path(spec).stem, view] = each
            for key, each in detectors.items():
                look(frame, source.truth(index), each, counts.setdefault(key, Found()))
    heads = [f"{STEP_M * step:.0f}–{STEP_M * (step + 1):.0f} m" for step in range(STEPS)]
    vehicles = next(iter(counts.values())).labelled
    print("| detector | view |", " | ".join(heads), "| unmatched a frame | CPU ms |")
    print("| vehicles | |", " | ".join(map(str, vehicles)), "| | |")
    for (name, view), found in counts.items():
        print(f"| {name} | {view} |", " | ".join(found.row()), "|")


if __name__ == "__main__":
    main()
