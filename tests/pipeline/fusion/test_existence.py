"""What speaks for an object and what against it, and what a sensor cannot know."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pipeline.fusion.existence import ExistenceState, weigh
from pipeline.params import ExistenceParams
from pipeline.types import F32, I32, U8, FusedObject, Ground, Point3
from tests.pipeline.build import fused

PARAMS = ExistenceParams()
ROAD_M = -0.6
ROAD = Ground(np.zeros(0, bool), np.array([[0.0, 0.0, 1.0, -ROAD_M]]), np.array([0.0, 100.0]), np.ones(1, bool))


@dataclass(frozen=True)
class Rays:
    """A sweep as far as rays matter."""

    points: F32
    ground: Ground | None = ROAD
    origin: Point3 = (0.0, 0.0, 0.0)
    cluster: int = -2
    """Of every point; negative: none."""

    @property
    def kind(self) -> I32:
        return np.full(len(self.points), self.cluster, np.int32)

    @property
    def ring(self) -> U8:
        """Each height is a ring."""
        return np.unique(self.points[:, 2], return_inverse=True)[1].astype(np.uint8)


def returns(range_m: float, bearing_deg: float = 0.0, height_m: float = 0.6) -> F32:
    """Eleven rays in a fan of 2°, each ending at that range and that height over the road."""
    turn = np.radians(bearing_deg + np.linspace(-1.0, 1.0, 11))
    z = np.full(11, ROAD_M + height_m)
    return np.stack([range_m * np.cos(turn), range_m * np.sin(turn), z, np.zeros(11)], axis=1).astype(np.float32)


NOTHING: F32 = np.zeros((0, 4), np.float32)


def camera_car(range_m: float = 12.0, sigma_m: float = 1.2, score: float = 0.8) -> FusedObject:
    return replace(fused(1, range_m, source="V"), distance_sigma_m=sigma_m, score=score)


def after(item: FusedObject, rays: Rays, frames: int = 5, params: ExistenceParams = PARAMS) -> FusedObject:
    state = ExistenceState()
    for k in range(frames):
        state, (found,) = weigh(state, (item,), rays, 0.1 if k else None, params)
    return found


def gate(item: FusedObject) -> bool | None:
    """What the gate on the free road says; None where it says nothing."""
    return next((each.passed for each in item.gates if each.name == "free_road"), None)


@pytest.mark.parametrize(
    ("points", "exists", "said"),
    [
        pytest.param(NOTHING, True, None, id="no ray came that way: cannot know"),
        pytest.param(returns(40.0), False, False, id="rays at body height are returned by something far behind"),
        pytest.param(returns(12.5), True, True, id="rays end where it is said to be"),
        pytest.param(returns(5.0), True, None, id="something nearer stops them: cannot know"),
        pytest.param(returns(40.0, bearing_deg=15.0), True, None, id="rays beside it"),
        pytest.param(returns(40.0, height_m=8.0), True, None, id="rays over its roof"),
        pytest.param(returns(40.0, height_m=-0.5), True, None, id="rays under it"),
    ],
)
def test_what_a_working_lidar_would_have_to_see(points: F32, exists: bool, said: bool | None) -> None:
    found = after(camera_car(), Rays(points))
    assert found.existence is not None
    assert (found.existence > 0.5, gate(found)) == (exists, said)


ASIDE = np.concatenate([returns(30.0, bearing_deg=side) for side in (-20.0, 20.0)])
"""A ring at body height, of which nothing comes back from straight ahead."""
TARMAC = returns(6.0, height_m=0.0)
"""The road before the place, which proves that the sensor looks there."""


@pytest.mark.parametrize(
    ("points", "range_m", "exists", "said"),
    [
        pytest.param([ASIDE, TARMAC], 12.0, False, False, id="the ring looks there and nothing comes back"),
        pytest.param([ASIDE], 12.0, True, None, id="no ring has anything there: the window may be dirty"),
        pytest.param([TARMAC], 12.0, True, None, id="no ring is known to look there at body height"),
        pytest.param([ASIDE, TARMAC, returns(5.0)], 12.0, True, None, id="something nearer hides it"),
        pytest.param([ASIDE, TARMAC], 45.0, True, None, id="too far for a VLP-16"),
    ],
)
def test_silence_speaks_against_it(points: list[F32], range_m: float, exists: bool, said: bool | None) -> None:
    found = after(camera_car(range_m, sigma_m=1.2), Rays(np.concatenate(points)))
    assert found.existence is not None
    assert (found.existence > 0.5, gate(found)) == (exists, said)


@pytest.mark.parametrize(
    ("range_m", "exists"), [pytest.param(12.0, False, id="near"), pytest.param(30.0, True, id="too far to have one")]
)
def test_near_by_a_vehicle_has_a_cluster_of_its_own(range_m: float, exists: bool) -> None:
    """A second box beside a parked car: what rays find there is the parked car, which another object is."""
    found = after(camera_car(range_m), Rays(returns(range_m + 0.5), cluster=3))
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


def test_rays_start_at_the_sensor() -> None:
    """A ray from a roof passes over the place although its return, behind, is at body height."""
    high = Rays(returns(40.0, height_m=0.6), origin=(0.0, 0.0, 3.0))
    assert gate(after(camera_car(), high)) is None
    assert gate(after(camera_car(), Rays(returns(40.0, height_m=0.6)))) is False


def test_a_vague_distance_needs_rays_through_all_of_it() -> None:
    """12 ± 1.2 m and a wall at 17 m: the car cannot be there. 12 ± 4 m: it may be the wall that was taken for it."""
    wall = Rays(returns(17.0))
    assert gate(after(camera_car(sigma_m=1.2), wall)) is False
    assert gate(after(camera_car(sigma_m=4.0), wall)) is True


def test_a_surer_box_is_likelier_there_and_repeating_it_does_not_help() -> None:
    nothing = Rays(NOTHING)
    by_score = [after(camera_car(score=score), nothing).existence for score in (0.3, 0.45, 0.6, 0.9)]
    assert by_score == sorted(by_score)  # type: ignore[type-var]
    assert by_score[1] == pytest.approx(0.5)
    assert (
        after(camera_car(score=0.35), nothing, frames=50).existence == after(camera_car(score=0.35), nothing).existence
    )


def test_a_cluster_speaks_for_it_whatever_the_box_says() -> None:
    both = replace(fused(1, 12.0, source="VL"), score=0.3)
    found = after(both, Rays(returns(40.0)))
    assert found.existence is not None
    assert found.existence > 0.9


def test_what_the_lidar_knew_lasts_a_while_when_it_loses_it() -> None:
    state = ExistenceState()
    for item in [fused(1, 12.0, source="VL")] * 5 + [camera_car(score=0.4)]:
        state, (found,) = weigh(state, (item,), Rays(NOTHING), 0.1, PARAMS)
    assert found.existence is not None
    assert found.existence > 0.9


def test_switched_off_nothing_is_said() -> None:
    found = after(camera_car(), Rays(returns(40.0)), params=ExistenceParams(enabled=False))
    assert (found.existence, gate(found)) == (None, None)
