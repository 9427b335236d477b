"""People on foot and on bicycles are drawn, hit by rays, and boxed, within the size of their cuboid."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.simulation import scenario
from pipeline.simulation.drawing.lens import ORDINARY
from pipeline.simulation.drawing.meshes import mesh
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import truth_boxes
from pipeline.simulation.sensors.camera import DrawnCamera, calibration
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.simulation.world import world_state
from pipeline.simulation.world.actors import SIZES_M, ActorKind
from pipeline.simulation.world.roadside import Roadside

NO_ROADSIDE = Roadside((), np.zeros(0), np.zeros((0, 3)))
PEOPLE: tuple[ActorKind, ...] = ("bicycle", "pedestrian")


def scene(kind: str, heading_deg: float = 90.0, ahead_m: float = 12.0) -> Scenario:
    return scenario.parse(
        f"""
title: test
duration_s: 1
road: {{segments: [{{length_m: 2000}}], lanes_forward: 1, lanes_oncoming: 1, median_m: 0, lane_width_m: 3.5}}
ego: {{lane: -1, speed_mps: {{0: 0}}}}
free_actors:
  - {{id: 1, kind: {kind}, s_m: {100 + ahead_m}, d_m: -1.75, heading_deg: {heading_deg}, speed_mps: {{0: 1}}}}
""",
        "test.yaml",
    )


@pytest.mark.parametrize("kind", PEOPLE)
@pytest.mark.parametrize("factor", [0.6, 1.0, 1.1])
def test_a_mesh_fills_its_cuboid(kind: ActorKind, factor: float) -> None:
    length, width, height = (factor * side for side in SIZES_M[kind])
    vertices = mesh(kind, (length, width, height)).vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    assert low[2] == pytest.approx(0.0, abs=0.01)
    assert high[2] == pytest.approx(height, abs=0.02)
    assert high[0] - low[0] == pytest.approx(length, abs=0.12)
    assert width / 2 < high[1] - low[1] < width + 0.12


@pytest.mark.parametrize("kind", PEOPLE)
@pytest.mark.parametrize("heading_deg", [0.0, 90.0])
def test_the_image_changes_where_the_cuboid_is(kind: ActorKind, heading_deg: float) -> None:
    with_one, alone = scene(kind, heading_deg), scene(kind, heading_deg).without_others()
    drawn = DrawnCamera(with_one.road, NO_ROADSIDE, 0)
    images = [drawn.image(world_state.at(each, 0.0)).astype(int) for each in (with_one, alone)]
    changed = np.argwhere(np.abs(images[0] - images[1]).max(axis=2) > 40)
    (seen,) = truth_boxes.in_image(world_state.at(with_one, 0.0), calibration(ORDINARY))
    x1, y1, x2, y2 = seen.bbox
    inside = (changed[:, 1] > x1 - 3) & (changed[:, 1] < x2 + 3) & (changed[:, 0] > y1 - 3) & (changed[:, 0] < y2 + 3)
    assert inside.sum() > 0.15 * (x2 - x1) * (y2 - y1)
    assert np.ptp(changed[inside, 0]) > 0.85 * (y2 - y1)


@pytest.mark.parametrize("kind", PEOPLE)
def test_rays_hit_it_within_its_cuboid(kind: ActorKind) -> None:
    made = scene(kind)
    now = world_state.at(made, 0.0)
    points = Lidar().sweep(now, NO_ROADSIDE, 0, 0, 0).points[:, :3]
    (state,) = now.actors
    length, width, height = state.cuboid.size
    away = np.abs(points - state.cuboid.center) - np.array([width / 2, length / 2, height / 2])
    on_it = (away < 0.1).all(axis=1) & (points[:, 2] > -0.3)
    assert on_it.sum() > 15
    assert np.ptp(points[on_it, 2]) > 0.6


@pytest.mark.parametrize(("kind", "label"), [("bicycle", "bicycle"), ("pedestrian", "person")])
def test_detections_have_the_class_of_coco(kind: str, label: str) -> None:
    made = scene(kind)
    found = truth_boxes.boxes(world_state.at(made, 0.0), calibration(ORDINARY), BoxNoise(missed=0.0), 0, 0)
    assert found.labels == (label,)
