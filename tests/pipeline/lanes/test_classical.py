"""Paint by colour and gradient, on images drawn for the purpose."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from pipeline.lanes.classical import open_classical
from pipeline.lanes.horizon import horizon_row
from pipeline.lanes.road_lines import LaneState, RoadView, follow
from pipeline.params import LaneParams
from pipeline.types import U8
from tests.pipeline.build import moment
from tests.pipeline.lanes.lane_scenes import GROUND_M, HEIGHT, STRAIGHT, WIDTH, aligned, camera

ASPHALT, WHITE, YELLOW = (88, 86, 84), (235, 235, 235), (60, 190, 225)
_PAINT_M = 0.15


def road(left=WHITE, right=WHITE, *, light: float = 1.0, noise: float = 3.0, lines=STRAIGHT) -> U8:
    """An image of a road with two painted lines; None omits one. light: 1 is daylight."""
    bgr = np.full((HEIGHT, WIDTH, 3), ASPHALT, np.uint8)
    bgr[: HEIGHT // 2] = (230, 200, 170)
    x = 1.0 / np.linspace(1 / 3.0, 1 / 60.0, 80)
    for colour, (y_m, *_) in zip((left, right), lines, strict=True):
        if colour is not None:
            sides = [np.column_stack([x, np.full(80, y_m + s * _PAINT_M / 2), np.full(80, GROUND_M)]) for s in (-1, 1)]
            around = np.concatenate([aligned().project(sides[0]), aligned().project(sides[1])[::-1]])
            cv2.fillPoly(bgr, [np.round(around).astype(np.int32)], colour, cv2.LINE_AA)
    grain = np.random.default_rng(0).normal(0.0, noise, bgr.shape)
    return np.clip(bgr * light + grain, 0, 255).astype(np.uint8)


def lane_in(bgr: U8):
    raw = open_classical(camera()).detect(bgr)
    _, lane = follow(LaneState(), raw, RoadView(aligned()), moment(), LaneParams(mount_height_m=-GROUND_M))
    assert lane is not None
    return lane


@pytest.mark.parametrize(("left", "right"), [(WHITE, WHITE), (YELLOW, WHITE), (YELLOW, YELLOW)])
def test_white_and_yellow_paint_is_found(left, right) -> None:
    lane = lane_in(road(left, right))
    assert lane.left is not None
    assert lane.right is not None
    assert float(lane.left.y_m(10.0)) == pytest.approx(1.75, abs=0.06)
    assert float(lane.right.y_m(10.0)) == pytest.approx(-1.75, abs=0.06)
    assert min(lane.left.quality, lane.right.quality) > 0.7


def test_yellow_on_bright_concrete_is_found_by_its_colour() -> None:
    bgr = road(YELLOW, None)
    bgr[HEIGHT // 2 :][(bgr[HEIGHT // 2 :].max(axis=2) < 130)] = (165, 175, 180)
    assert lane_in(bgr).left is not None


def test_one_line_alone_is_one_line() -> None:
    lane = lane_in(road(WHITE, None))
    assert lane.left is not None
    assert lane.right is None


NOTHING = {
    "no paint": road(None, None),
    "night": road(light=0.06),
    "black": np.zeros((HEIGHT, WIDTH, 3), np.uint8),
    "overexposed": np.full((HEIGHT, WIDTH, 3), 255, np.uint8),
    "noise": np.random.default_rng(3).integers(0, 255, (HEIGHT, WIDTH, 3)).astype(np.uint8),
    "smaller than a lane": np.zeros((24, 32, 3), np.uint8),
}


@pytest.mark.parametrize("image", NOTHING)
def test_where_there_is_nothing_no_lane_is_believed(image: str) -> None:
    lane = lane_in(NOTHING[image])
    assert lane.left is None or lane.left.quality < 0.5
    assert lane.right is None or lane.right.quality < 0.5
    assert lane.left is None or lane.right is None


def test_a_shadows_edge_is_no_line() -> None:
    bgr = road(None, None)
    for shadow in (slice(0, 400), slice(900, WIDTH)):
        bgr[HEIGHT // 2 :, shadow] = bgr[HEIGHT // 2 :, shadow] // 3
    points = open_classical(camera()).detect(bgr).points
    assert np.all((np.abs(points[:, 0] - 400) > 8) & (np.abs(points[:, 0] - 900) > 8))


@pytest.mark.parametrize(("pitch_deg", "row"), [(0.0, 360.0), (2.0, 360.0 - 1000.0 * np.tan(np.radians(2.0)))])
def test_the_horizon_is_where_the_road_vanishes(pitch_deg: float, row: float) -> None:
    assert horizon_row(camera(pitch_down_deg=pitch_deg)) == pytest.approx(row, abs=0.1)


def test_its_name_says_for_which_camera_it_is() -> None:
    names = {open_classical(None).name, open_classical(camera()).name, open_classical(camera(3.0)).name}
    assert len(names) == 3
    assert open_classical(None).notes


def test_points_lie_in_the_image() -> None:
    raw = open_classical(camera()).detect(road(noise=20.0))
    assert raw.points.dtype == np.float32
    assert np.all((raw.points >= 0) & (raw.points < (WIDTH, HEIGHT)))
    assert np.all((raw.scores >= 0) & (raw.scores <= 1))
    assert np.all(raw.line == -1)


def test_another_camera():
    assert open_classical(None).of_camera(camera(3.0)) == open_classical(camera(3.0))
