"""An angle and its change, from vehicles that each have an error of their own."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.fusion.drift.estimate import SIDE_DEG, AngleChange, AngleSightings, box_errors, changes
from pipeline.types import F64


def sightings(vehicles: int, pieces: int, rates: F64 | None = None) -> AngleSightings:
    """Every vehicle in every time interval."""
    piece, vehicle = (each.ravel() for each in np.meshgrid(np.arange(pieces), np.arange(vehicles), indexing="ij"))
    rate = np.zeros(len(piece)) if rates is None else rates[vehicle]
    frames, count = np.full(len(piece), 5.0), len(piece)
    new, lasting = box_errors(frames, np.full(count, 3.0), rate, np.zeros(count, bool), np.zeros(count))
    return AngleSightings(piece, vehicle, vehicle, frames, rate, new, lasting, np.zeros(count, bool))


def shown(seen: AngleSightings, before: float, after: float, at: int, time_s: float = 0.0, seed: int = 0) -> F64:
    rng = np.random.default_rng(seed)
    own = rng.normal(0.0, 0.2, seen.vehicle.max() + 1)
    angle = np.where(seen.piece >= at, after, before)
    return angle + own[seen.vehicle] + time_s * seen.rate_degps + rng.normal(0.0, 0.2, len(seen.piece))


def one(seen: AngleSightings, values: F64, moment: int) -> AngleChange:
    return changes(seen, values, np.array([moment]))


def test_a_change_is_known_better_than_the_angle():
    """Vehicles seen before and after it have the same error."""
    seen = sightings(3, 40)
    found = one(seen, shown(seen, 0.0, 0.5, 20), 20)
    assert found.after[0] - found.before[0] == pytest.approx(0.5, abs=0.2)
    alone = one(seen, shown(seen, 0.5, 0.5, 0), 0)
    assert found.after_sigma[0] < alone.after_sigma[0]


def test_the_sigma_covers_the_errors():
    """Over many draws, the errors have the standard deviation that is stated."""
    seen = sightings(5, 20)
    draws = [one(seen, shown(seen, 0.0, 1.0, 10, seed=k), 10) for k in range(200)]
    off = np.array([(each.after[0] - 1.0) / each.after_sigma[0] for each in draws])
    assert 0.6 < off.std() < 1.1


def test_one_wrong_pair_has_little_effect():
    seen = sightings(5, 20)
    values = shown(seen, 0.0, 0.0, 0)
    values[seen.vehicle == 0] += 3.0
    assert abs(one(seen, values, 0).after[0]) < 0.3


def test_a_time_offset_is_told_from_an_angle():
    rates = np.array([5.0, -5.0, 3.0, -4.0, 1.0])
    seen = sightings(5, 20, rates)
    found = one(seen, shown(seen, 0.0, 0.0, 0, time_s=0.1), 0)
    assert 0.03 < found.time_s[0] < 0.12, "held near zero"
    assert abs(found.after[0]) < 0.25


def test_a_vehicle_whose_side_is_seen_too_tells_less_of_the_yaw():
    frames, height = np.full(2, 5.0), np.full(2, 5.0)
    new, lasting = box_errors(frames, height, np.zeros(2), np.array([False, True]), np.zeros(2))
    assert new[0] == new[1]
    assert lasting[1] ** 2 - lasting[0] ** 2 == pytest.approx(SIDE_DEG**2)
