"""A residential street, cars parked on both sides, nothing in the path nearer than 60 m: nothing may lead or brake."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import iou_matrix
from pipeline.formats.kitti_records import parse_labels
from pipeline.params import AlignmentParams
from pipeline.run import Sensors
from pipeline.sources import open_source
from pipeline.sources.kitti import KittiSource
from pipeline.types import VEHICLES, Box
from tests.accuracy.drives import FOLDERS, drive

FAR_M = 60.0


class Labelled(NamedTuple):
    """A labelled vehicle."""

    box: Box
    """Its cuboid in the image."""
    nearest_m: float
    """Of its corners."""


class Placed(NamedTuple):
    """A vehicle seen only by the camera, with its label."""

    true_m: float
    distance_m: float
    sigma_m: float


@pytest.mark.parametrize("own_motion", [True, False], ids=["own motion", "none"])
@pytest.mark.parametrize("sensors", ["both", "camera", "lidar"])
def test_nothing_leads_and_nothing_brakes(data_dir: Path, sensors: Sensors, own_motion: bool) -> None:
    results = drive(data_dir, "street", sensors=sensors, own_motion=own_motion).results
    assert len(results) == 51
    near = {name: result.cipv for name, result in results.items() if result.cipv and result.cipv.distance_m < FAR_M}
    assert near == {}
    assert {name for name, result in results.items() if result.acc is not None and result.acc.brake > 0.0} == set()


def test_no_car_is_nearer_than_half_its_true_distance(data_dir: Path) -> None:
    placed = list(_placed(data_dir))
    assert len(placed) > 250
    assert [each for each in placed if each.distance_m < 0.5 * each.true_m] == []


def test_the_sigma_of_a_cars_distance_is_no_fiction(data_dir: Path) -> None:
    """90 % of the errors are within two sigmas, in each 20 m bin with enough of them."""
    cells = defaultdict(list)
    for each in _placed(data_dir):
        cells[int(each.true_m // 20)].append(abs(each.distance_m - each.true_m) < 2 * each.sigma_m)
    judged = {20 * cell: float(np.mean(held)) for cell, held in cells.items() if len(held) >= 20}
    assert len(judged) >= 3
    assert min(judged.values()) >= 0.9, judged


def _placed(folder: Path) -> Iterator[Placed]:
    """Each labelled vehicle seen only by the camera, in each frame."""
    labels = _labels(folder)
    for index, result in enumerate(drive(folder, "street", sensors="camera").results.values()):
        seen = [item for item in result.objects if not item.carried and item.distance_m and item.distance_sigma_m]
        seen = [item for item in seen if item.label in VEHICLES and item.bbox is not None]
        if not seen or not labels[index]:
            continue
        overlap = iou_matrix(
            np.array([each.box for each in labels[index]]), np.array([item.bbox or (0, 0, 0, 0) for item in seen])
        )
        for column, item in enumerate(seen):
            row = int(overlap[:, column].argmax())
            if overlap[row, column] >= 0.5 and int(overlap[row].argmax()) == column:
                yield Placed(labels[index][row].nearest_m, item.distance_m or 0.0, item.distance_sigma_m or 0.0)


@cache
def _labels(folder: Path) -> list[list[Labelled]]:
    """By frame, from the drive's labels in the format of KITTI's tracking benchmark."""
    source = open_source(f"kitti:{folder / FOLDERS['street']}")
    assert isinstance(source, KittiSource)
    lines = defaultdict(list)
    for line in (folder / "kitti_0009" / "label_02.txt").read_text().splitlines():
        frame, _, *row = line.split()
        lines[int(frame)].append(" ".join(row))
    found = []
    for index, camera in enumerate(frame.camera for frame in source.outlines()):
        aligned = resolve(AlignmentParams(), camera)
        assert camera is not None
        assert aligned is not None
        of_frame = []
        for each in parse_labels("\n".join(lines[index]).encode(), source.T_rect_ego(index)):
            corners = each.cuboid.corners()
            box = project_cuboid(aligned, corners, camera.width, camera.height)
            if each.label in VEHICLES and box is not None:
                of_frame.append(Labelled(box, float(np.hypot(corners[:, 0], corners[:, 1]).min())))
        found.append(of_frame)
    return found
