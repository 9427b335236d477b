"""A wrong focal length is found with the mount, by boxes if it is far off and by depth edges if it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import Pinhole, corrected, resolve
from pipeline.calibration.alignment.edges import EdgeView
from pipeline.calibration.alignment.fit import fit_alignment
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.params import AlignmentParams, Params, with_changes
from tests.pipeline.calibration.alignment.made_drive import CAMERA, drive
from tests.pipeline.calibration.alignment.test_edges import view

TURNED = AlignmentParams(yaw_deg=3.0, pitch_deg=-2.0, roll_deg=1.0)


def seen(zoom: float) -> tuple[list[FitScene], list[EdgeView]]:
    """A drive of a turned camera whose focal length is so many times the calibration's."""
    aligned = resolve(TURNED.model_copy(update={"zoom": zoom}), CAMERA)
    assert aligned is not None
    scenes = drive(aligned)
    return scenes, [view(aligned, k)._replace(t_ns=scene.t_ns) for k, scene in enumerate(scenes)]


@pytest.mark.parametrize("zoom", [0.85, 1.18])
def test_a_far_wrong_focal_length_is_found_by_vehicles_alone(zoom: float):
    fit = fit_alignment(seen(zoom)[0], "pinhole", AlignmentParams())
    assert fit.values["zoom"] == pytest.approx(zoom, rel=0.015)
    assert fit.values["yaw_deg"] == pytest.approx(3.0, abs=0.2)
    assert fit.values["pitch_deg"] == pytest.approx(-2.0, abs=0.2)
    assert 0.0 < fit.sigmas["zoom"] < 0.03
    assert "the calibration's focal length is wrong" in fit.warnings[0]
    assert fit.after.mean_iou > 0.8


@pytest.mark.parametrize("offset", [False, True])
def test_a_slightly_wrong_one_is_found_by_edges(offset: bool):
    scenes, views = seen(1.03)
    fit = fit_alignment(scenes, "pinhole", AlignmentParams(), offset, edges=views)
    assert fit.values["zoom"] == pytest.approx(1.03, abs=0.01)
    assert fit.values["yaw_deg"] == pytest.approx(3.0, abs=0.2)
    for name, value in {"pitch_deg": -2.0, "roll_deg": 1.0}.items():
        assert abs(fit.values[name] - value) < 3.0 * fit.sigmas[name], "as far as the made edges determine it"
    assert with_changes(Params(), fit.changes).alignment.zoom == fit.values["zoom"]


def test_a_right_one_is_kept():
    scenes, views = seen(1.0)
    fit = fit_alignment(scenes, "pinhole", AlignmentParams(zoom=1.1), edges=views)
    assert "zoom" not in fit.values
    assert "zoom" not in fit.sigmas
    assert fit.changes["alignment.zoom"] == 1.0, "an earlier fit's does not stay"
    assert fit.before is not None
    assert fit.before.mean_iou < fit.after.mean_iou


def test_zoom_scales_the_focal_length_and_nothing_else():
    found = corrected(AlignmentParams(zoom=1.1), CAMERA)
    assert found.K[0, 0] == pytest.approx(1.1 * CAMERA.K[0, 0])
    assert found.K[1, 1] == pytest.approx(1.1 * CAMERA.K[1, 1])
    assert found.K[:2, 2].tolist() == CAMERA.K[:2, 2].tolist()
    assert np.array_equal(found.T_camera_ego, CAMERA.T_camera_ego)
    aligned = resolve(AlignmentParams(zoom=1.1), CAMERA)
    assert isinstance(aligned, Pinhole)
    wider = resolve(AlignmentParams(), replace(CAMERA, K=found.K))
    assert wider is not None
    points = np.array([[10.0, 2.0, -1.0], [30.0, -8.0, 0.5]])
    assert aligned.project(points) == pytest.approx(wider.project(points))
