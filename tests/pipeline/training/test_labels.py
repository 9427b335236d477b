"""Labels against what is really drawn, and against the pinhole formula."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.camera import DrawnCamera, calibration
from pipeline.simulation.world import world_state
from pipeline.simulation.world.roadside import Roadside
from pipeline.training.labels import CLASSES, Label, labels

_CAR = {"kind": "car", "lane": -1, "speed_mps": {0.0: 0.0}}


def _scenario(*actors: dict[str, Any]) -> Scenario:
    return Scenario.model_validate(
        {
            "title": "standing",
            "duration_s": 1.0,
            "road": {"segments": [{"length_m": 1000.0}], "lanes_forward": 2, "lanes_oncoming": 0},
            "ego": {"lane": -1, "speed_mps": {0.0: 0.0}},
            "actors": [{"id": number, **_CAR, **actor} for number, actor in enumerate(actors, start=1)],
        }
    )


def _labels(*actors: dict[str, Any]) -> dict[int, Label]:
    return {label.actor_id: label for label in labels(world_state.at(_scenario(*actors), 0.0), calibration())}


@pytest.mark.parametrize("ahead_m", [8.0, 30.0, 90.0])
def test_the_height_of_a_box_is_the_pinhole_camera_s(ahead_m: float) -> None:
    (label,) = _labels({"ahead_m": ahead_m}).values()
    focal_px = calibration().K[1, 1]
    height_px = label.box[3] - label.box[1]
    assert height_px == pytest.approx(focal_px * 1.48 / (ahead_m + 1.6), rel=0.08)
    assert label.distance_m == pytest.approx(np.hypot(ahead_m, 1.82 / 2), abs=0.01)
    assert (label.visible, label.ahead, label.cut) == (1.0, True, False)


def test_the_box_is_where_the_vehicle_is_drawn() -> None:
    """Two images that differ only in the car's paint differ inside its box, up to its edges."""
    images, found = [], None
    for colour in ("#ff0000", "#0000ff"):
        now = world_state.at(_scenario({"ahead_m": 5.0, "lane": -2, "colour": colour}), 0.0)
        scenario = _scenario()
        camera = DrawnCamera(scenario.road, Roadside.build(scenario.road, 1, 0.0, 700.0), 1)
        images.append(camera.image(now).astype(int))
        (found,) = labels(now, calibration())
    assert found is not None
    rows, columns = np.nonzero(np.abs(images[0] - images[1]).sum(axis=2) > 60)
    x1, y1, x2, y2 = found.box
    assert (columns.min(), columns.max()) == (pytest.approx(x1, abs=4), pytest.approx(x2, abs=4))
    assert rows.min() == pytest.approx(y1, abs=4)
    assert y1 < rows.max() < y2  # tyres keep their colour


def test_a_nearer_vehicle_hides_a_farther_one() -> None:
    both = _labels({"ahead_m": 8.0, "kind": "truck"}, {"ahead_m": 40.0}, {"ahead_m": 9.0, "lane": -2})
    assert [both[number].visible for number in (1, 3)] == [1.0, 1.0]
    assert both[2].visible < 0.05
    assert CLASSES[both[1].label] == "truck"


@pytest.mark.parametrize(("ahead_m", "there"), [(-20.0, False), (-3.0, False), (3.0, True)])
def test_who_is_beside_the_car_is_cut_by_the_image(ahead_m: float, there: bool) -> None:
    found = _labels({"ahead_m": ahead_m, "lane": -2, "kind": "bus"})
    assert bool(found) == there
    for label in found.values():
        assert label.cut
        assert label.box[2] == 1280.0
        assert not label.ahead


def test_a_van_is_a_car() -> None:
    assert CLASSES[_labels({"ahead_m": 20.0, "kind": "van"})[1].label] == "car"
