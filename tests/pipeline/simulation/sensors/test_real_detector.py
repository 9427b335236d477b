"""Boxes with the errors of a real detector: as often and as far off as the measured numbers say, in any order."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.common.geometry import iou_matrix
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.camera import calibration
from pipeline.simulation.sensors.measured_noise import FalseBoxes, measured
from pipeline.simulation.sensors.real_detector import RealDetector
from pipeline.simulation.sensors.truth_boxes import in_image, visible_part
from pipeline.simulation.world import world_state
from pipeline.types import Box

CAMERA = calibration()
NO_FALSE = FalseBoxes(per_frame=0.0, lasts=0.0, seen=(), height_share=0.0)


def road(ahead_m: float, seconds: float = 200.0) -> Scenario:
    """A car that keeps its distance."""
    return Scenario.model_validate(
        {
            "title": "one car",
            "seed": 4,
            "duration_s": seconds,
            "road": {"segments": [{"length_m": 9000.0}]},
            "ego": {"lane": -2, "speed_mps": {0.0: 10.0}},
            "actors": [{"id": 1, "kind": "car", "lane": -2, "ahead_m": ahead_m, "speed_mps": {0.0: 10.0}}],
        }
    )


@pytest.mark.parametrize("ahead_m", [20.0, 52.0])
def test_a_car_is_missed_in_bursts_as_often_as_measured(ahead_m: float) -> None:
    scene = road(ahead_m)
    noise = measured().model_copy(update={"false_boxes": NO_FALSE})
    detector = RealDetector(scene, noise)
    now = world_state.at(scene, 1.0)
    found = np.array([len(detector.boxes(now, CAMERA, index).boxes) > 0 for index in range(scene.frame_count())])
    middles = (np.array(noise.ranges_m)[1:] + np.array(noise.ranges_m)[:-1]) / 2
    wanted = float(np.interp(ahead_m, middles, noise.found[0]))
    assert found.mean() == pytest.approx(wanted, abs=0.06)
    if wanted < 0.9:
        again = (~found[1:] & ~found[:-1]).sum() / (~found[:-1]).sum()
        assert again > 2.0 * (1.0 - wanted)  # a missed one is likelier to be missed again


def test_boxes_are_off_by_what_was_measured_and_the_same_in_any_order() -> None:
    scene = road(20.0)
    noise = measured().model_copy(update={"false_boxes": NO_FALSE, "doubled": 0.0})
    detector, now = RealDetector(scene, noise), world_state.at(scene, 1.0)
    (seen,) = in_image(now, CAMERA)
    height = seen.bbox[3] - seen.bbox[1]
    boxes = [detector.boxes(now, CAMERA, index).boxes for index in range(0, scene.frame_count(), 7)]
    off = np.vstack([box for box in boxes if len(box)]) - np.array(seen.bbox)
    new = np.hypot(noise.frame_share, noise.frame_px / height)
    assert off.std(axis=0) / height == pytest.approx(np.hypot([noise.across_share, noise.up_share] * 2, new), rel=0.35)
    again = RealDetector(scene, noise)
    for index in (150, 3, 42):
        assert np.array_equal(again.boxes(now, CAMERA, index).boxes, detector.boxes(now, CAMERA, index).boxes)


def test_false_boxes_stand_in_the_world_and_are_as_many_as_measured() -> None:
    scene = road(20.0, 60.0).model_copy(update={"actors": ()})
    detector = RealDetector(scene)
    boxes = [detector.boxes(world_state.at(scene, n / 10.0), CAMERA, n).boxes for n in range(scene.frame_count())]
    counts = np.array([len(each) for each in boxes])
    of = measured().false_boxes
    assert 0.5 * of.per_frame < counts.mean() < 1.2 * of.per_frame  # some are outside of this narrower image
    lasting = [(iou_matrix(a, b).max(axis=1) > 0.25).mean() for a, b in pairwise(boxes) if len(a) and len(b)]
    assert np.mean(lasting) == pytest.approx(of.lasts, abs=0.15)


def test_the_box_of_a_half_hidden_car_leaves_out_a_part_of_what_is_hidden() -> None:
    """The car ahead in the next lane is partly behind a lorry in that lane."""
    scene = road(40.0)
    near = scene.actors[0].model_copy(update={"id": 2, "lane": -1, "kind": "truck", "ahead_m": 15.0})
    far = scene.actors[0].model_copy(update={"lane": -1, "ahead_m": 45.0})
    scene = scene.model_copy(update={"actors": (near, far)})
    now = world_state.at(scene, 1.0)
    hidden = next(each for each in in_image(now, CAMERA) if each.actor.actor.id == 1)
    strip = np.array(hidden.shown) - np.array(hidden.bbox)
    edge = int(np.abs(strip).argmax())
    assert 0.4 < hidden.visible < 1.0

    def mean_off(cut: float) -> float:
        noise = measured().model_copy(update={"false_boxes": NO_FALSE, "doubled": 0.0, "hidden_cut": cut})
        drawn = [RealDetector(scene, noise).boxes(now, CAMERA, index).boxes for index in range(0, 1500, 10)]
        of_it = [
            box[edge] - hidden.bbox[edge] for boxes in drawn for box in boxes if abs(box[1] - hidden.bbox[1]) < 12.0
        ]
        return float(np.mean(of_it))

    assert mean_off(0.5) - mean_off(0.0) == pytest.approx(0.5 * strip[edge], rel=0.2)


@pytest.mark.parametrize(
    ("nearer", "shown", "share"),
    [
        pytest.param([], (0.0, 0.0, 24.0, 12.0), 1.0, id="nothing nearer"),
        pytest.param([(-5.0, -5.0, 6.0, 20.0)], (6.0, 0.0, 24.0, 12.0), 0.75, id="the left quarter"),
        pytest.param([(-5.0, 6.0, 50.0, 20.0)], (0.0, 0.0, 24.0, 6.0), 0.5, id="the lower half"),
        pytest.param([(6.0, -5.0, 12.0, 20.0)], (0.0, 0.0, 24.0, 12.0), 0.75, id="a post in the middle"),
        pytest.param([(-5.0, -5.0, 50.0, 20.0)], (0.0, 0.0, 24.0, 12.0), 0.0, id="everything"),
    ],
)
def test_what_nearer_boxes_leave_of_one(nearer: list[Box], shown: Box, share: float) -> None:
    part, seen = visible_part((0.0, 0.0, 24.0, 12.0), nearer)
    assert part == pytest.approx(shown)
    assert seen == pytest.approx(share)
