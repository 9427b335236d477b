"""Where boxes of real vehicles meet the road, against labels: better than by their height, and as sure as said."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import iou_matrix
from pipeline.common.stopwatch import Stopwatch
from pipeline.detection import Detectors, detect
from pipeline.fusion.ground_contact import measure_contacts, road_ahead
from pipeline.lidar.segmentation import segment
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import VEHICLES
from pipeline.vision import nms
from pipeline.vision.distance import measure
from pipeline.vision.vehicle_height import BoxShape, RoadContact, hinted, other_class
from tests import looking
from tests.accuracy.drives import FOLDERS

FAR_M, SAME_IOU = 20.0, 0.5


class Placed(NamedTuple):
    """A labelled vehicle's distance by one box, as ln(estimated / true)."""

    by_height: float
    with_road: float
    """After the road corrected the height."""
    sigma: float


def placed(folder: Path) -> Iterator[Placed]:
    source, params = open_source(f"astyx:{folder / FOLDERS['astyx']}"), Params()
    for index in range(len(source)):
        frame = source.frame(index)
        assert frame.image is not None
        height, width = frame.image.bgr.shape[:2]
        seen = Detectors(looking.yolox_nano(folder, width, height), far=looking.far_view(folder, width, height))
        frame, aligned = detect(frame, seen), resolve(params.alignment, frame.camera)
        assert frame.raw_boxes is not None
        assert aligned is not None
        law = frame.raw_boxes.law
        boxes = measure(nms.select(frame.raw_boxes, params.detection), aligned, frame.camera, params.distance, law)
        sweep = segment(frame.sweep, frame.ego, params, Stopwatch())
        boxes = (
            measure_contacts(boxes, road_ahead(sweep.points, sweep.ground, boxes, aligned), aligned, params.fusion)
            or ()
        )
        truth = [item for item in source.truth(index) or () if item.label in VEHICLES]
        corners = [item.cuboid.corners() for item in truth]
        drawn = [project_cuboid(aligned, each, width, height) or (0.0, 0.0, 0.0, 0.0) for each in corners]
        overlap = iou_matrix(np.array([each.detection.bbox for each in boxes]).reshape(-1, 4), np.array(drawn))
        for row, each in enumerate(boxes):
            if each.road is None or each.distance_m is None or overlap[row].max(initial=0.0) < SAME_IOU:
                continue
            true_m = float(np.hypot(*corners[int(overlap[row].argmax())][:, :2].T).min())
            contact, other = RoadContact().seen(each.road), other_class(each.detection.label, each.class_factors)
            known = hinted(BoxShape().seen(each.aspect), contact, each.size_share or 0.0, other)
            by_height = math.log(each.distance_m / true_m)
            sigma = math.hypot(known.share(each.size_share or 0.0), each.noise_share or 0.0)
            if true_m > FAR_M:
                yield Placed(by_height, by_height + known.mean, sigma)


def test_far_vehicles_are_placed_better_by_the_road_than_by_their_height(data_dir: Path) -> None:
    found = list(placed(data_dir))
    by_height = float(np.mean([abs(each.by_height) for each in found]))
    with_road = float(np.mean([abs(each.with_road) for each in found]))
    held = float(np.mean([abs(each.with_road) < 2.0 * each.sigma for each in found]))
    print(
        f"{len(found)} boxes beyond {FAR_M:g} m: {by_height:.3f} by height, {with_road:.3f} with the road; {held:.2f}"
    )
    assert len(found) > 30
    assert with_road < 0.7 * by_height
    assert held > 0.9
