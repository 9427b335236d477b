"""Sensor data as every stage gets it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.types import Sweep


def test_the_arrays_of_a_sweep_are_of_one_type_for_the_kernels() -> None:
    points, ring, time_s = np.ones((3, 4), np.float32), np.arange(3, dtype=np.uint8), np.zeros(3, np.float32)
    kept = Sweep(0, points, ring, 16, time_s)
    assert kept.points is points
    assert kept.ring is ring
    assert kept.time_s is time_s
    for each in (points, ring, time_s):
        each.flags.writeable = False
    for made in (Sweep(0, points, ring, 16, time_s), replace(kept, origin=(0.0, 0.0, 1.0))):
        assert made.points.flags.writeable
        assert made.ring.flags.writeable
        assert made.time_s is not None
        assert made.time_s.flags.writeable
        np.testing.assert_array_equal(made.points, points)
        np.testing.assert_array_equal(made.ring, ring)
    assert Sweep(0, points, ring, 16).time_s is None
