"""Speeds of labelled vehicles: what a fit over the frames around gives, and where it gives none."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.scores.velocities import Velocities, velocities
from pipeline.types import F64

TENTH_NS = 100_000_000


def of(x: F64 | list[float], step_ns: int = TENTH_NS, absent: tuple[int, ...] = ()) -> Velocities:
    """One vehicle straight ahead, at x in each frame, missing in some."""
    return velocities((n * step_ns, {} if n in absent else {4: (float(at), 1.0)}) for n, at in enumerate(x))


def speeds(found: Velocities, step_ns: int = TENTH_NS) -> dict[int, float]:
    """Speed along x, by frame."""
    return {tick // step_ns: each[4][0] for tick, each in found.mps.items()}


@pytest.mark.parametrize("step_s", [0.05, 0.1, 0.3])
def test_a_braking_vehicle_has_its_speed_at_the_ends_too(step_s: float) -> None:
    t = np.arange(12) * step_s
    found = of(60.0 - 10.0 * t + 1.5 * t**2, int(step_s * 1e9))
    off = [abs(speed - (-10.0 + 3.0 * t[n])) for n, speed in speeds(found, int(step_s * 1e9)).items()]
    assert len(off) == 12
    assert max(off[1:-1]) < 1e-6
    assert max(off) < (1e-6 if step_s < 0.2 else 3.0 * step_s / 2 + 1e-6), "two places know no acceleration"
    assert not found.jumps


def test_labels_that_are_a_decimetre_off_give_a_speed() -> None:
    t = np.arange(200) / 10
    found = of(60.0 - 2.0 * t + np.random.default_rng(3).normal(0.0, 0.1, 200))
    off = np.array([speed + 2.0 for n, speed in speeds(found).items() if 3 <= n <= 196])
    assert len(off) > 180
    assert float(np.sqrt(np.mean(off**2))) < 0.25, "of two places 0.2 s apart it is 0.7 m/s"


def test_a_track_that_jumps_has_no_speed_there() -> None:
    x = [30.0 - 0.2 * n + (8.0 if n >= 10 else 0.0) for n in range(20)]
    found = of(x)
    assert sorted(tick // TENTH_NS for tick, _ in found.jumps) == [7, 8, 9, 10, 11, 12]
    assert speeds(found) == pytest.approx({n: -2.0 for n in range(20) if not 7 <= n <= 12})


def test_three_places_that_no_vehicle_goes_through_have_no_speed() -> None:
    """As in a track of Astyx, accepted as proposed by the pipeline: two vehicles with one id."""
    found = of([5.0, 14.9, 10.7], 300_000_000)
    assert 300_000_000 not in found.mps
    assert found.jumps == {(300_000_000, 4)}


@pytest.mark.parametrize(
    ("step_ns", "absent", "known"),
    [
        pytest.param(TENTH_NS, (), [0, 1, 2, 3, 4], id="whole"),
        pytest.param(TENTH_NS, (1,), [2, 3, 4], id="alone before a frame that it is not in"),
        pytest.param(TENTH_NS, (1, 3), [], id="no two frames in a row"),
        pytest.param(700_000_000, (), [0, 1, 2, 3, 4], id="neighbours count however far apart, to the trackers' gap"),
        pytest.param(10_000_000_000, (), [], id="across a gap"),
    ],
)
def test_where_there_is_a_speed(step_ns: int, absent: tuple[int, ...], known: list[int]) -> None:
    found = of([30.0 - 2.0 * n * step_ns / 1e9 for n in range(5)], step_ns, absent)
    assert speeds(found, step_ns) == pytest.approx(dict.fromkeys(known, -2.0))
    assert not found.jumps


def test_vehicles_are_kept_apart() -> None:
    found = velocities((n * TENTH_NS, {1: (20.0 - n, 0.0), 2: (50.0, n / 5)}) for n in range(3))
    for each in found.mps.values():
        assert each[1] == pytest.approx((-10.0, 0.0), abs=1e-9)
        assert each[2] == pytest.approx((0.0, 2.0), abs=1e-9)
    assert velocities([]) == Velocities({}, frozenset())
