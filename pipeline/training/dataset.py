"""The training set as files: images at the network's scale as JPEG, labels as one table.

``python -m pipeline.training.dataset FOLDER --count 4000 --seed 1``
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np

from pipeline.simulation.sensors.camera import calibration
from pipeline.training.labels import labels
from pipeline.training.scenes import moments
from pipeline.types import F32

SCALE = 0.5
"""Network pixels per image pixel: 1280×720 becomes 640×360."""
COLUMNS = ("picture", "class", "x1", "y1", "x2", "y2", "visible", "distance_m")
_JPEG_QUALITY = 96


def write(folder: Path, count: int, seed: int) -> None:
    """``count`` images as 000000.jpg …, and ``labels.npy`` (N, 8) float32 of ``COLUMNS``, boxes in network pixels."""
    folder.mkdir(parents=True, exist_ok=True)
    camera = calibration()
    rows = []
    for number, moment in enumerate(moments(seed, count)):
        small = cv2.resize(moment.image, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_LINEAR)
        cv2.imwrite(str(folder / f"{number:06d}.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        for label in labels(moment.world, camera):
            box = [edge * SCALE for edge in label.box]
            rows.append([number, label.label, *box, label.visible, label.distance_m])
    np.save(folder / "labels.npy", np.array(rows, dtype=np.float32))


def read_labels(folder: Path) -> list[F32]:
    """For each image its (M, 8) rows of ``COLUMNS``."""
    table = np.load(folder / "labels.npy")
    count = len(list(folder.glob("*.jpg")))
    return [table[table[:, 0] == number] for number in range(count)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=4000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    write(options.folder, options.count, options.seed)


if __name__ == "__main__":
    main()
