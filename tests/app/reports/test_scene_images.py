"""Scenes in a report: everybody in the plan, where they are, and the image of the same moment."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np
import pytest

from app.reports.scene_images import plan_svg, scene_html
from pipeline.evaluation.report_sections import Scene
from pipeline.simulation import scenario
from pipeline.simulation.world import world_state


@pytest.mark.parametrize("name", ["straight", "turn_across_left"])
def test_the_plan_has_everybody_where_they_are(name: str) -> None:
    scene = scenario.load(name)
    now = world_state.at(scene, 5.0)
    svg = plan_svg(scene, now, name)
    cars = re.findall(r'<polygon class="car"[^>]*points="([^"]+)"', svg)
    assert len(cars) == len(now.actors) > 1
    for drawn, state in zip(cars, now.actors, strict=True):
        corners = np.array([point.split(",") for point in drawn.split()], dtype=float) * (1, -1)
        np.testing.assert_allclose(corners, state.cuboid.footprint()[:, :2], atol=0.006)
    assert svg.count('class="way"') == len(cars), "and where it will be"
    assert svg.count('class="tarmac"') == len(scene.road.edges_m()) + len(scene.road.crossings)


def test_the_image_is_in_the_page() -> None:
    figure = scene_html(Scene("Straight <road>", scenario.load("straight"), 5.0))
    assert "Straight &lt;road&gt;, at 5.0 s" in figure
    found = re.search(r'src="data:image/jpeg;base64,([^"]+)"', figure)
    assert found is not None
    image = cv2.imdecode(np.frombuffer(base64.b64decode(found[1]), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape == (360, 640, 3)
    assert image.std() > 20.0
