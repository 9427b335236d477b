"""A part of a footprint that is cut off is no motion; what appears at its side may be."""

from __future__ import annotations

import pytest

from pipeline.common.geometry import Cuboid
from pipeline.lidar.tracking import LidarTrackerState, track
from pipeline.params import LidarTrackingParams
from pipeline.types import Obstacle

DT_S = 0.1
APART, TOGETHER = LidarTrackingParams(), LidarTrackingParams(cut_off_is_no_motion=False)


def between(low_m: float, high_m: float) -> Obstacle:
    """What stands 12 m ahead, from one ego y to the other."""
    middle_m = (low_m + high_m) / 2
    box = Cuboid((12.15, middle_m, 0.0), (0.3, high_m - low_m, 1.5), 0.0)
    return Obstacle(0, box, (12.0, middle_m, 0.0), 30, 75.0, (0.1, 0.5, 0.4))


def sideways(sides: list[tuple[float, float]], params: LidarTrackingParams = APART) -> list[float]:
    """The track's lateral speed after each sighting but the first, m/s."""
    state, speeds = LidarTrackerState(), []
    for k, (low_m, high_m) in enumerate(sides):
        state, (found,) = track(state, (between(low_m, high_m),), DT_S if k else None, params)
        if found.velocity_mps is not None:
            speeds.append(found.velocity_mps[1])
    return speeds


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["the right one leaves", "the left one leaves"])
def test_two_pedestrians_who_were_one_cluster_do_not_push_each_other_when_they_part(side: float) -> None:
    """One walks to the road at 1.7 m/s, the other stays."""
    walks = [(-5.3, -4.8 + 0.17 * k) for k in range(8)]
    alone = [(-5.3 + 0.17 * k, -4.8 + 0.17 * k) for k in range(8, 12)]
    seen = [(low, high) if side > 0.0 else (-high, -low) for low, high in walks + alone]
    before, *after = (side * speed for speed in sideways(seen)[6:])
    assert max(after) < 1.8
    assert after[-1] > before, "of its own motion, it is told more and more"
    assert max(side * speed for speed in sideways(seen, TOGETHER)[7:]) > 2.5, "what the jump alone would have told"


def test_a_crossing_cars_front_that_disappears_does_not_brake_it() -> None:
    crosses = [(-6.0 + k, -2.0 + k) for k in range(8)]
    hidden = [(-6.0 + k, 5.0) for k in range(8, 11)]  # behind a parked one, from y = 5 m on
    assert min(sideways(crosses + hidden)[6:]) > 9.0
    assert min(sideways(crosses + hidden, TOGETHER)[6:]) < 8.0


def test_a_crossing_cars_front_that_appears_is_motion() -> None:
    appears = [(-6.0, -5.5), *((-6.0, -5.0 + k) for k in range(4))]
    assert sideways(appears) == sideways(appears, TOGETHER)
    assert sideways(appears)[-1] > 3.0


def test_what_appears_for_one_sweep_makes_up_for_itself() -> None:
    """As twigs of a hedge do: both jumps count, so that no speed remains."""
    seen = [(-6.0, -4.0)] * 6 + [(-6.0, -3.0)] + [(-6.0, -4.0)] * 5
    assert sideways(seen) == sideways(seen, TOGETHER)
    assert abs(sideways(seen)[-1]) < 0.3


def test_what_moves_as_a_whole_is_as_fast_as_before() -> None:
    steps = [(0.17 * k * k / 10, 1.8 + 0.17 * k * k / 10) for k in range(12)]
    assert sideways(steps) == sideways(steps, TOGETHER)
