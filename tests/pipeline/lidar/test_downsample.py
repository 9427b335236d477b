"""Thinning is per channel."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pipeline.lidar.downsample import keep_mask
from pipeline.params import DownsampleParams
from pipeline.types import Sweep


def _sweep(ring: list[int]) -> Sweep:
    points = np.tile(np.array([10.0, 0.0, 0.0, 0.0], np.float32), (len(ring), 1))
    return Sweep(0, points, np.array(ring, np.uint8), 16)


def test_the_own_body_is_dropped_but_nothing_ahead_of_the_bumper() -> None:
    places = [(-0.6, 0.3), (0.05, -0.9), (-1.1, 0.0), (0.6, 0.3), (1.1, 0.0)]
    points = np.array([[x, y, 0.0, 0.0] for x, y in places], np.float32)
    kept = keep_mask(Sweep(0, points, np.zeros(5, np.uint8), 16), DownsampleParams(blind_range_m=1.0))
    assert kept.tolist() == [False, False, True, True, True]


def test_every_second_point_of_each_channel_in_the_order_of_the_sweep() -> None:
    kept = keep_mask(_sweep([0, 1, 0, 1, 0, 1, 1]), DownsampleParams(keep_every=2))
    assert kept.tolist() == [True, True, False, False, True, True, False]


@given(st.lists(st.integers(0, 15), max_size=200), st.integers(1, 10))
def test_each_channel_keeps_its_share(ring: list[int], keep_every: int) -> None:
    kept = keep_mask(_sweep(ring), DownsampleParams(keep_every=keep_every))
    for channel in set(ring):
        of_channel = kept[np.array(ring) == channel]
        assert of_channel.sum() == -(-len(of_channel) // keep_every)
        assert of_channel[0]
