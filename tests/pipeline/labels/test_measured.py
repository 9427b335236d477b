"""Cuboids from the sensors' data: laid on points, lifted out of the image. Made-up scenes, and real cars."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.common.geometry import Cuboid
from pipeline.labels.cuboid_from_pixel import NothingThere, lift
from pipeline.labels.cuboids import snap
from pipeline.labels.cuboids.snap import TooFewPoints, refit
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.types import F32, Box, Frame, RawBoxes
from tests.app.engine.recording_helpers import Recording

GROUND_M = -0.6


def sweep_of(car: Cuboid, *, faces: str = "both") -> F32:
    """A flat road, and the visible faces of a car: its rear, or its right side too."""
    x, y = np.meshgrid(np.arange(2.0, 40.0, 0.4), np.arange(-8.0, 8.01, 0.4))
    road = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, GROUND_M)])
    (cx, cy, _), (length, width, height), yaw_rad = car
    along, up = np.meshgrid(np.linspace(-0.5, 0.5, 20), np.linspace(GROUND_M + 0.3, GROUND_M + height, 6))
    rear = np.column_stack([np.full(along.size, -length / 2), along.ravel() * width])
    side = np.column_stack([along.ravel() * length, np.full(along.size, -width / 2)])
    flat = np.vstack([rear, side] if faces == "both" else [rear])
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    z = np.tile(up.ravel(), len(flat) // along.size)
    placed = np.column_stack([cx + c * flat[:, 0] - s * flat[:, 1], cy + s * flat[:, 0] + c * flat[:, 1], z])
    xyz = np.vstack([road, placed])
    return np.column_stack([xyz, np.full(len(xyz), 10.0)]).astype(np.float32)


def box_in_image(frame: Frame, cuboid: Cuboid) -> Box | None:
    """The box of a cuboid in the image; None outside it."""
    assert frame.camera is not None
    alignment = resolve(Params().alignment, frame.camera)
    assert alignment is not None
    return project_cuboid(alignment, cuboid.corners(), frame.camera.width, frame.camera.height)


def standing(x: float, y: float, yaw_rad: float = 0.0, size: tuple[float, float, float] = (4.4, 1.8, 1.5)) -> Cuboid:
    return Cuboid((x, y, GROUND_M + size[2] / 2), size, yaw_rad)


@pytest.mark.parametrize(("dx", "dy", "dyaw"), [(0.6, -0.3, 0.1), (-0.5, 0.5, -0.15), (0.5, 0.0, 0.0)])
def test_a_cuboid_near_a_car_is_laid_on_it(dx: float, dy: float, dyaw: float) -> None:
    car = standing(15.0, 4.0, 0.1)
    found = refit(sweep_of(car), standing(15.0 + dx, 4.0 + dy, 0.1 + dyaw))
    assert (found.is_better, found.turned) == (True, dyaw != 0.0)
    assert found.points > 200
    assert found.cuboid.center == pytest.approx(car.center, abs=0.12)
    assert found.cuboid.size == pytest.approx(car.size, abs=0.12)
    assert found.cuboid.yaw_rad == pytest.approx(0.1, abs=math.radians(2.0))


def test_of_a_cuboid_that_is_slightly_off_only_the_contradicted_side_is_moved() -> None:
    """Whether it is too short or in the wrong place, nobody saw its front."""
    car = standing(15.0, 4.0)
    found = refit(sweep_of(car, faces="rear"), standing(15.3, 4.0))
    assert found.is_better
    assert found.cuboid.center[0] - found.cuboid.size[0] / 2 == pytest.approx(15.0 - 4.4 / 2, abs=0.05)
    assert found.cuboid.center[0] + found.cuboid.size[0] / 2 == pytest.approx(15.3 + 4.4 / 2)


def test_a_cuboid_that_fits_is_left_as_it_is() -> None:
    car = standing(15.0, 4.0, 0.1)
    found = refit(sweep_of(car), car)
    assert (found.is_better, found.cuboid) == (False, car)


def test_a_cuboid_that_contains_its_points_is_left_although_they_are_away_from_its_sides() -> None:
    """What is missing between the points and a side may be hidden."""
    car, drawn = standing(15.0, 4.0, 0.1), standing(15.0, 4.0, 0.1, (5.6, 2.4, 1.5))
    found = refit(sweep_of(car), drawn)
    assert (found.is_better, found.cuboid) == (False, drawn)


def test_a_cuboid_near_the_ground_is_left_at_its_height_and_one_that_floats_is_put_on_it() -> None:
    """The ground is measured to a decimetre or two, too."""
    car = standing(15.0, 4.0, 0.1)
    x, y, z = car.center
    near = refit(sweep_of(car), car._replace(center=(x, y, z + 0.15)))
    assert (near.is_better, near.cuboid.center[2]) == (False, z + 0.15)
    floating = refit(sweep_of(car), car._replace(center=(x, y, z + 0.5)))
    assert floating.cuboid.center[2] == pytest.approx(z, abs=0.05)


def test_a_heading_that_is_far_off_is_left_to_the_person() -> None:
    car = standing(15.0, 4.0, 0.1)
    found = refit(sweep_of(car), standing(15.3, 4.2, 0.1 - math.radians(18)))
    assert (found.is_better, found.turned) == (False, False)


def test_points_of_a_wider_body_do_not_widen_a_car() -> None:
    """Two cars side by side, whose points have grown together."""
    found = refit(sweep_of(standing(15.0, 4.0, 0.1, (4.4, 2.6, 1.5))), standing(15.0, 4.3, 0.1))
    assert found.cuboid.size[1] == pytest.approx(1.8)


def test_of_a_car_seen_from_behind_length_and_turn_are_a_hands() -> None:
    car = standing(15.0, 0.0)
    found = refit(sweep_of(car, faces="rear"), standing(15.5, 0.2, 0.02))
    assert (found.turned, found.cuboid.yaw_rad) == (False, 0.02)
    assert found.cuboid.size == pytest.approx(car.size, abs=0.1)
    assert found.cuboid.center[0] == pytest.approx(15.0, abs=0.1)
    assert found.cuboid.center[2] == pytest.approx(car.center[2], abs=0.05)


def test_a_part_seen_in_one_sweep_turns_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rear and a metre of the side: a corner has a yaw of its own."""
    sweep, drawn = sweep_of(standing(13.4, 3.84, 0.1, (1.2, 1.8, 1.5))), standing(15.0, 4.1, 0.0)
    assert not refit(sweep, drawn).turned
    monkeypatch.setattr(snap, "_FEWEST_TO_TURN", 0)
    assert refit(sweep, drawn).turned, "the points would have it so"


def test_a_cuboid_that_is_too_small_grows() -> None:
    car = standing(15.0, 4.0, 0.1)
    found = refit(sweep_of(car), standing(14.5, 3.9, 0.1, (3.6, 1.6, 1.2)))
    assert found.cuboid.size == pytest.approx(car.size, abs=0.12)


def test_points_that_say_something_else_turn_nothing() -> None:
    found = refit(sweep_of(standing(15.0, 4.0, 0.3)), standing(15.0, 4.0, 0.3 + math.radians(40)))
    assert (found.turned, found.cuboid.yaw_rad) == (False, pytest.approx(0.3 + math.radians(40)))


def test_too_few_points_are_said() -> None:
    with pytest.raises(TooFewPoints, match="0 points in and near"):
        refit(sweep_of(standing(15.0, 4.0)), standing(30.0, -5.0))


# ------------------------------------------------------------ out of the image


@pytest.fixture(scope="module")
def frame() -> Frame:
    """A car's rear 26 m ahead, with points and image."""
    return Recording().frame(10)


BOX = (150.0, 86.0, 170.0, 101.0)


def test_a_box_around_points_is_laid_on_them(frame: Frame) -> None:
    found = lift(frame, Params(), "car", bbox=BOX)
    assert found.how == f"fitted to the {found.points} points there"
    assert found.cuboid.center[0] - found.cuboid.size[0] / 2 == pytest.approx(26.0, abs=0.05)
    assert found.cuboid.center[1] == pytest.approx(0.0, abs=0.05)
    assert found.cuboid.center[2] - found.cuboid.size[2] / 2 == pytest.approx(GROUND_M, abs=0.1)


def test_a_click_takes_the_detection_it_is_in_or_the_points_it_is_on(frame: Frame) -> None:
    small, large = BOX, (100.0, 50.0, 250.0, 150.0)
    boxes = RawBoxes("test", np.array([large, small], np.float32), np.ones(2, np.float32), ("car", "car"))
    assert lift(replace(frame, raw_boxes=boxes), Params(), "car", pixel=(160.0, 93.0)).bbox == small
    bare = lift(frame, Params(), "car", pixel=(160.0, 93.0))
    assert (bare.bbox, bare.points > 5) == (None, True)


def test_without_points_it_is_as_far_as_it_looks(frame: Frame) -> None:
    blind = replace(frame, sweep=None)
    car = standing(40.0, 0.0)
    bbox = box_in_image(frame, car)
    assert bbox is not None
    found = lift(blind, Params(), "car", bbox=bbox)
    assert found.points == 0
    assert found.how.startswith("no points there: about")
    assert found.how.endswith("judging by its height in the image")
    assert found.cuboid.center[0] == pytest.approx(40.0, rel=0.2)
    assert found.cuboid.center[1] == pytest.approx(0.0, abs=0.5)


def test_where_nothing_tells_it_is_said(frame: Frame) -> None:
    with pytest.raises(NothingThere, match="draw a box around it"):
        lift(frame, Params(), "car", pixel=(3.0, 3.0))
    with pytest.raises(NothingThere, match="such a box gives no distance for a person"):
        lift(replace(frame, sweep=None), Params(), "person", bbox=BOX)
    with pytest.raises(NothingThere, match="not calibrated"):
        lift(replace(frame, camera=None), Params(), "car", bbox=BOX)


def test_real_cars_are_found_where_the_labels_have_them(data_dir: Path) -> None:
    """Astyx: the cars in every fifth frame that the LiDAR sees, from a box around them and from a point 0.7 m
    off."""
    source = open_source(f"astyx:{data_dir / 'astyx'}")
    lifted, fitted = [], []
    for index in range(0, len(source), 5):
        frame = source.frame(index)
        assert frame.sweep is not None
        assert frame.camera is not None
        for item in source.truth(index) or ():
            box = box_in_image(frame, item.cuboid)
            if item.label.lower() != "car" or box is None or _points_in(frame, item.cuboid) < 10:
                continue
            x, y, z = item.cuboid.center
            off = Cuboid((x + 0.6, y - 0.4, z), item.cuboid.size, item.cuboid.yaw_rad + 0.1)
            fitted.append(_apart(refit(frame.sweep.points, off).cuboid, item.cuboid))
            if box[0] > 1.0 and box[2] < frame.camera.width - 1.0:
                lifted.append(_apart(lift(frame, Params(), "car", bbox=box).cuboid, item.cuboid))
    assert len(fitted) >= 8
    assert np.median(fitted) < 0.35
    assert np.median(lifted) < 0.5


def _apart(a: Cuboid, b: Cuboid) -> float:
    return math.hypot(a.center[0] - b.center[0], a.center[1] - b.center[1])


def _points_in(frame: Frame, cuboid: Cuboid) -> int:
    assert frame.sweep is not None
    c, s = math.cos(cuboid.yaw_rad), math.sin(cuboid.yaw_rad)
    d = frame.sweep.points[:, :3] - np.array(cuboid.center, np.float32)
    along, across = np.abs(c * d[:, 0] + s * d[:, 1]), np.abs(c * d[:, 1] - s * d[:, 0])
    inside = (along <= cuboid.size[0] / 2) & (across <= cuboid.size[1] / 2) & (d[:, 2] > -cuboid.size[2] / 2 + 0.2)
    return int((inside & (d[:, 2] < cuboid.size[2] / 2)).sum())
