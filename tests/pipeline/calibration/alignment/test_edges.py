"""The roll of a camera from depth edges, on edge images that are made for a known mount."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.alignment.projection import Alignment
from pipeline.calibration.alignment.edges import EdgeView, roll_scores
from pipeline.calibration.alignment.fit import fit_alignment
from pipeline.calibration.alignment.models import FitModel
from pipeline.calibration.alignment.solve import SHARED_DEG
from pipeline.calibration.depth_edges import EdgeScene
from pipeline.params import AlignmentParams
from pipeline.types import F64
from tests.pipeline.calibration.alignment.made_drive import CAMERA, SIZE, drive

MODEL = FitModel("pinhole", CAMERA, SIZE)
EVERY_NS = 500_000_000


def view(true: Alignment, number: int, edges: int = 120) -> EdgeView:
    """A frame with posts, walls and vehicles all around, and their edges in the image."""
    rng = np.random.default_rng(number)
    range_m, bearing = rng.uniform(6.0, 40.0, edges), np.radians(rng.uniform(-35.0, 35.0, edges))
    points = np.column_stack([range_m * np.cos(bearing), range_m * np.sin(bearing), rng.uniform(-1.5, 3.0, edges)])
    strength = rng.integers(0, 60, (SIZE[1], SIZE[0])).astype(np.uint8)
    seen = true.project(points)
    for u, v in seen[np.isfinite(seen[:, 0])]:
        if 6 <= u < SIZE[0] - 6 and 2 <= v < SIZE[1] - 2:
            strength[int(v) - 2 : int(v) + 3, int(u) - 4 : int(u) + 5] = 200
    return EdgeView(EdgeScene(points, strength, strength.mean(axis=1, dtype=np.float32)), number * EVERY_NS)


def at(roll_deg: float) -> F64:
    return np.array([0.0, 0.0, roll_deg])


@pytest.mark.parametrize("roll_deg", [-3.3, 0.0, 1.4])
def test_the_roll_is_found(roll_deg: float):
    found = roll_scores([view(MODEL.aligned(at(roll_deg)), k) for k in range(8)], MODEL, at)
    assert found is not None
    assert found.best_deg() == pytest.approx(roll_deg, abs=0.2)
    assert found.sigma_deg() < 0.3


def test_images_without_the_edges_say_nothing():
    views = [view(MODEL.aligned(at(0.0)), k) for k in range(8)]
    scenes = [each.scene for each in views]
    foreign = [replace(own, points=other.points) for own, other in zip(scenes, scenes[1:] + scenes[:1], strict=True)]
    others = [each._replace(scene=scene) for each, scene in zip(views, foreign, strict=True)]
    assert roll_scores(others, MODEL, at) is None
    assert roll_scores(views[:3], MODEL, at) is None, "too short"
    assert roll_scores([], MODEL, at) is None


def test_edges_fix_the_roll_where_all_vehicles_are_ahead():
    true = MODEL.aligned(np.array([1.0, -0.8, 1.5]))
    scenes = drive(true, bearing_deg=6.0, walls=2)
    views = [view(true, k)._replace(t_ns=scene.t_ns) for k, scene in enumerate(scenes)]
    boxes = fit_alignment(scenes, "pinhole", AlignmentParams())
    both = fit_alignment(scenes, "pinhole", AlignmentParams(), edges=views)
    assert both.sigmas["roll_deg"] == pytest.approx(SHARED_DEG["roll_deg"], abs=0.01), "what no drive can show"
    assert boxes.sigmas["roll_deg"] > 2 * both.sigmas["roll_deg"]
    assert both.values["roll_deg"] == pytest.approx(1.5, abs=0.2)
    assert both.values["yaw_deg"] == pytest.approx(1.0, abs=0.2)
    assert both.values["pitch_deg"] == pytest.approx(-0.8, abs=0.2)
