"""A camera that has turned sees every lane line turned, while the car drives along them as before."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.fusion.drift.lines import LineState, RoadLines, angles, closed, noted
from pipeline.types import F64

FRAME_NS, SPEED_MPS = 100_000_000, 15.0


def driven(
    frames: int,
    turned_deg: float = 0.0,
    heading_deg: float = 0.0,
    curvature_per_m: float = 0.0,
    pitch_deg: float | None = None,
    speed_mps: float = SPEED_MPS,
    knows_turning: bool = True,
) -> LineState:
    """A lane of 3.5 m whose lines the car crosses at an angle. turned_deg: of the camera, to the left. heading_deg: of
    the lines against the car. curvature_per_m: of car and lines."""
    state = LineState()
    for k in range(frames):
        across = np.radians(heading_deg) * speed_mps * k * FRAME_NS / 1e9
        slope = np.radians(heading_deg - turned_deg)
        lines = np.array([[y + across, slope, curvature_per_m / 2.0, 0.0] for y in (1.75, -1.75)])
        turning = curvature_per_m * speed_mps if knows_turning else None
        state = noted(state, RoadLines(lines, pitch_deg, speed_mps, turning), k * FRAME_NS)
    return closed(state, 7, 0.0)


def yaws(state: LineState) -> F64:
    return angles(state, 0).values


@pytest.mark.parametrize("turned_deg", [-2.0, 0.0, 0.5])
@pytest.mark.parametrize("heading_deg", [0.0, 1.5])
@pytest.mark.parametrize("curvature_per_m", [0.0, 1e-3])
def test_the_yaw_is_told_also_in_a_lane_change_and_in_a_bend(
    turned_deg: float, heading_deg: float, curvature_per_m: float
):
    assert yaws(driven(6, turned_deg, heading_deg, curvature_per_m)) == pytest.approx([turned_deg], abs=0.02)


def test_it_is_more_certain_at_speed():
    slow, fast = (angles(driven(6, speed_mps=speed), 0).sigma_deg[0] for speed in (5.0, 30.0))
    assert slow > 2.0 * fast


@pytest.mark.parametrize(
    "drive",
    [{"speed_mps": 1.0}, {"knows_turning": False}, {"curvature_per_m": 0.01}, {"frames": 2}],
    ids=["walking pace", "unknown yaw rate", "sharp bend", "too short"],
)
def test_nothing_is_said_where_motion_is_no_measure(drive: dict[str, float]):
    assert not len(yaws(driven(**{"frames": 6, **drive})))  # type: ignore[arg-type]


def test_another_line_is_not_compared():
    """The left line ends, and another one begins 2 m beside it."""
    state = LineState()
    for k in range(6):
        y = 1.75 if k < 3 else 3.75
        lines = np.array([[y, 0.0, 0.0, 0.0], [-1.75, 0.0, 0.0, 0.0]])
        state = noted(state, RoadLines(lines, None, SPEED_MPS, 0.0), k * FRAME_NS)
    assert yaws(closed(state, 0, -1.0)) == pytest.approx([0.0])


def test_the_pitch_is_the_mean_of_the_images_with_two_lines():
    found = angles(driven(5, pitch_deg=1.2), 1)
    assert found.values == pytest.approx([1.2])
    assert found.frames == pytest.approx([5.0])
    assert not len(angles(driven(5), 1).values)


def test_the_pitch_is_worth_what_the_car_drives_because_hills_are_long():
    sigmas = [angles(driven(6, pitch_deg=1.0, speed_mps=speed), 1).sigma_deg[0] for speed in (2.0, 8.0)]
    assert sigmas[0] == pytest.approx(2.0 * sigmas[1])
    assert not len(angles(driven(6, pitch_deg=1.0, speed_mps=0.0), 1).values), "a standing car sees nothing new"
    unknown = noted(LineState(), RoadLines(np.zeros((2, 4)), 1.0, None, None), 0)
    unknown = noted(unknown, RoadLines(np.zeros((2, 4)), 1.0, None, None), FRAME_NS)
    assert not len(angles(closed(unknown, 0, -1.0), 1).values), "nor is it known whether it stands without a speed"


def test_what_is_old_is_forgotten():
    state = driven(6, 1.0)
    assert len(closed(state, 8, 6.0).rows) == 1
    assert len(closed(state, 8, 7.0).rows) == 0


@pytest.mark.parametrize(("noise_deg", "factor"), [(0.05, 1.0), (0.9, 3.0)])
def test_lines_that_scatter_are_less_certain_and_a_turn_is_no_scatter(noise_deg: float, factor: float):
    state, rng = LineState(), np.random.default_rng(3)
    turned = np.where(np.arange(40) < 20, 0.0, 1.5)
    yaw = turned + rng.normal(0.0, noise_deg, 40)
    rows = np.column_stack([np.arange(40), yaw, np.full(40, 0.25), np.full((40, 2), np.nan), np.full(40, 5.0)])
    sigma_deg = angles(state._replace(rows=rows), 0).sigma_deg
    assert sigma_deg == pytest.approx(0.25 * factor, rel=0.35)
    assert np.array_equal(angles(state._replace(rows=rows[:5]), 0).sigma_deg, rows[:5, 2]), "too few to tell"
