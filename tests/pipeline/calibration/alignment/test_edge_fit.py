"""The whole mount from depth edges, from where biased boxes leave it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.calibration.alignment.edge_fit import STEPS, fit_edges
from pipeline.calibration.alignment.fit import fit_alignment
from pipeline.calibration.alignment.models import FitModel
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE, drive
from tests.pipeline.calibration.alignment.test_edges import MODEL, view

WITH_PLACE = FitModel("pinhole", CAMERA, SIZE, offset=True)


@pytest.mark.parametrize(
    ("model", "true", "start"),
    [
        (MODEL, [1.0, -0.8, 1.5], [1.2, -1.1, 1.0]),
        (WITH_PLACE, [0.5, 0.3, -0.8, 0.1, -0.15], [0.6, 0.0, -0.5, 0.14, -0.03]),
    ],
    ids=["angles", "place too"],
)
def test_the_mount_is_found_near_that_of_the_boxes(model: FitModel, true: list[float], start: list[float]):
    views = [view(model.aligned(np.array(true)), k) for k in range(10)]
    told: list[int] = []
    found = fit_edges(views, model, np.array(start), told.append)
    assert found is not None
    assert found.vector[:3] == pytest.approx(true[:3], abs=0.3), "4 px: the made edges are that wide on both sides"
    assert found.vector[3:] == pytest.approx(true[3:], abs=0.04)
    assert (found.sigmas > 0.0).all()
    assert told == list(range(STEPS))


def test_edges_of_other_images_say_nothing():
    views = [view(MODEL.aligned(np.zeros(3)), k) for k in range(8)]
    scenes = [each.scene for each in views]
    foreign = [replace(own, points=other.points) for own, other in zip(scenes, scenes[1:] + scenes[:1], strict=True)]
    others = [each._replace(scene=scene) for each, scene in zip(views, foreign, strict=True)]
    found = fit_edges(others, MODEL, np.zeros(3))
    assert found is None or found.sigmas[2] > 0.3
    assert fit_edges(views[:3], MODEL, np.zeros(3)) is None, "too short"
    assert fit_edges([], MODEL, np.zeros(3)) is None


def test_boxes_that_are_all_drawn_too_high_do_not_move_the_camera():
    true = WITH_PLACE.aligned(np.array([0.6, -0.5, 0.8, 0.1, 0.1]))
    scenes = drive(true, walls=2)
    raised = []
    for scene in scenes:
        boxes = scene.boxes - [0.0, 0.06, 0.0, 0.06] * (scene.boxes[:, 3:] - scene.boxes[:, 1:2])
        raised.append(replace(scene, boxes=boxes))
    views = [view(true, k)._replace(t_ns=scene.t_ns) for k, scene in enumerate(scenes)]
    boxes_only = fit_alignment(raised, "pinhole", AlignmentParams(), offset=True)
    both = fit_alignment(raised, "pinhole", AlignmentParams(), offset=True, edges=views)
    assert abs(boxes_only.values["up_m"] - 0.1) > 0.06
    assert both.values["up_m"] == pytest.approx(0.1, abs=0.04)
    assert both.values["pitch_deg"] == pytest.approx(-0.5, abs=0.2)
    assert abs(both.values["up_m"] - 0.1) < 4.0 * both.sigmas["up_m"] + 0.02


def test_edges_that_contradict_the_boxes_are_not_followed():
    true, other = MODEL.aligned(np.zeros(3)), MODEL.aligned(np.array([0.9, 1.4, 0.0]))
    scenes = drive(true)
    views = [view(other, k)._replace(t_ns=scene.t_ns) for k, scene in enumerate(scenes)]
    fit = fit_alignment(scenes, "pinhole", AlignmentParams(), edges=views)
    assert fit.values["yaw_deg"] == pytest.approx(0.0, abs=0.2)
    assert fit.values["pitch_deg"] == pytest.approx(0.0, abs=0.2)
