"""Recovering rings from the order of points."""

from __future__ import annotations

import numpy as np

from pipeline.sources.kitti.hdl64_rings import keep_rings, match_vlp16, ring_elevations_deg, turns
from tests.pipeline.sources.conftest import rings_file


def points(count: int = 64) -> np.ndarray:
    return np.frombuffer(rings_file(count), dtype="<f4").reshape(-1, 4)


def test_each_turn_is_a_ring() -> None:
    turn = turns(points())
    assert turn.tolist() == np.repeat(np.arange(64), 40).tolist()


def test_jitter_at_straight_ahead_makes_no_ring() -> None:
    cloud = points(3).copy()
    cloud[41, 1] = -0.001  # a step back over 0° just after the second ring began
    assert turns(cloud).max() == 2


def test_one_and_no_point() -> None:
    assert turns(points()[:1]).tolist() == [0]
    assert turns(points()[:0]).tolist() == []


def test_near_returns_do_not_bend_a_rings_elevation() -> None:
    far = points(1).repeat(2, axis=0)
    near = far * np.array([0.1, 0.1, 1.0, 1.0])  # the same height from a tenth of the way: a laser mounted high
    cloud = np.vstack([far, near.repeat(3, axis=0)]).astype(np.float32)
    assert abs(ring_elevations_deg(cloud, np.zeros(len(cloud), dtype=np.int64), 1)[0] - 2.0) < 0.01


def test_every_channel_takes_its_nearest_free_ring() -> None:
    matched = match_vlp16(np.array([2.2, 1.2, 0.9, -1.0, -14.9, -15.3, np.nan]))
    assert matched == {4: 0, 3: 7, 2: 8, 0: 9}, "+3° takes 2.2°, which is 0.8° away"
    assert match_vlp16(np.array([2.0])) == {0: 8}, "taken once, by the first that it is near enough to"
    assert match_vlp16(np.array([])) == {}


def test_kept_points_carry_their_channel() -> None:
    cloud = points(4)
    kept, channel = keep_rings(cloud, turns(cloud), {1: 9, 3: 2})
    assert len(kept) == 80
    assert channel.tolist() == [9] * 40 + [2] * 40
    assert np.array_equal(kept[:40], cloud[40:80])
