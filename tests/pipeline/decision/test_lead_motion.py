"""The lead's acceleration: found with an honest sigma, and not mistaken for the car's own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import pytest

from pipeline.decision.lead_motion import LeadMotionState, follow
from pipeline.types import Cipv, EgoState, FusedObject
from tests.pipeline.build import fused, moment

DT_S = 0.1


def seen(distance_m: float, **changes: Any) -> FusedObject:
    """A lead whose distance the LiDAR has just measured."""
    return dataclasses.replace(fused(1, distance_m), **{"distance_sigma_m": 0.2, **changes})


def drive(
    lead_mps: Callable[[float], float],
    own_mps: Callable[[float], float],
    frames: int = 40,
    noise_m: float = 0.04,
    changes: Callable[[int], dict[str, Any]] = lambda _: {},
) -> list[Cipv]:
    """The leads told while two vehicles drive at these speeds, from 30 m apart."""
    state, gap_m, told, noise = LeadMotionState(), 30.0, [], np.random.default_rng(1)
    for n in range(frames):
        t_s = n * DT_S
        item = seen(gap_m + float(noise.normal(0.0, noise_m)), **changes(n))
        assert item.distance_m is not None
        lead = Cipv(item.id, item.distance_m, own_mps(t_s) - lead_mps(t_s), None, "")
        state, found = follow(state, lead, (item,), moment(EgoState(0, own_mps(t_s)), DT_S if n else None))
        assert found is not None
        told.append(found)
        middle_s = t_s + DT_S / 2
        gap_m += (lead_mps(middle_s) - own_mps(middle_s)) * DT_S
    return told


def known(told: Iterable[Cipv]) -> list[tuple[float, float]]:
    return [
        (each.accel_mps2, each.accel_sigma_mps2)
        for each in told
        if each.accel_mps2 is not None and each.accel_sigma_mps2 is not None
    ]


@pytest.mark.parametrize(
    ("lead_mps", "own_mps", "accel_mps2"),
    [
        pytest.param(lambda _: 15.0, lambda _: 15.0, 0.0, id="both keep their speed"),
        pytest.param(lambda t: 15.0 - 3.0 * t, lambda _: 15.0, -3.0, id="the lead brakes"),
        pytest.param(lambda t: 10.0 + 1.5 * t, lambda _: 10.0, 1.5, id="it pulls away"),
        pytest.param(lambda _: 15.0, lambda t: 15.0 - 4.0 * t, 0.0, id="only we brake"),
        pytest.param(lambda t: 15.0 - 3.0 * t, lambda t: 15.0 - 3.0 * t, -3.0, id="both brake: the gap stays"),
        pytest.param(lambda _: 0.0, lambda _: 5.0, 0.0, id="it stands"),
    ],
)
def test_acceleration_over_ground(
    lead_mps: Callable[[float], float], own_mps: Callable[[float], float], accel_mps2: float
) -> None:
    accel, sigma = known(drive(lead_mps, own_mps))[-1]
    assert accel == pytest.approx(accel_mps2, abs=2.0 * sigma)
    assert abs(accel - accel_mps2) < 0.7
    assert 0.3 < sigma < 0.8


def test_hard_braking_is_certain_within_a_second() -> None:
    told = drive(lambda t: 20.0 - max(t - 2.0, 0.0) * 5.0, lambda _: 20.0, frames=31)
    accel, sigma = known(told)[-1]
    assert accel < -2.0 * sigma
    assert all(abs(value) < 2.0 * of for value, of in known(told[:20])), "nothing before"


def test_a_lead_that_has_stopped_does_not_go_on_to_brake() -> None:
    told = known(drive(lambda t: max(8.0 - 4.0 * t, 0.0), lambda t: max(8.0 - 3.0 * t, 0.5), frames=60))
    assert min(value for value, _ in told) < -2.0
    assert told[-1][0] > -0.5


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param(lambda _: {"source": "V", "seen_by": "V", "distance_sigma_m": 3.0}, id="the camera alone"),
        pytest.param(lambda n: {"id": n // 8}, id="another lead every 0.8 s"),
    ],
)
def test_what_cannot_be_known_is_not_told(changes: Callable[[int], dict[str, Any]]) -> None:
    assert known(drive(lambda _: 15.0, lambda _: 15.0, changes=changes)) == []


def test_a_jump_to_another_part_or_vehicle_begins_anew() -> None:
    state = LeadMotionState()
    for n in range(20):
        ego = moment(EgoState(0, 15.0), DT_S if n else None)
        state, lead = follow(state, Cipv(1, 30.0, 0.0, None, ""), (seen(30.0),), ego)
    assert lead is not None
    assert lead.accel_mps2 == pytest.approx(0.0, abs=0.1)
    _, lead = follow(state, Cipv(1, 24.0, 0.0, None, ""), (seen(24.0),), moment(EgoState(0, 15.0), DT_S))
    assert lead is not None
    assert lead.accel_mps2 is None


def test_without_own_speed_or_lead_nothing_is_told() -> None:
    state = follow(LeadMotionState(), Cipv(1, 30.0, 0.0, None, ""), (seen(30.0),), moment(EgoState(0, 15.0), DT_S))[0]
    assert follow(state, None, (seen(30.0),), moment(EgoState(0, 15.0), DT_S)) == (LeadMotionState(), None)
    lead = Cipv(1, 30.0, 0.0, None, "")
    assert follow(state, lead, (seen(30.0),), moment(None, DT_S)) == (LeadMotionState(), lead)
