"""Evidence of the LiDAR's rays for and against an object, and what they cannot tell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.fusion.existence import Existence, ExistenceState, weigh
from pipeline.types import F32
from tests.pipeline.build import fused, moment
from tests.pipeline.fusion.ray_towards import FRAME, NOTHING, PARAMS, Rays, after, camera_car, gate, returns


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
"""A ring at body height without returns from straight ahead."""
TARMAC = returns(6.0, height_m=0.0)
"""Returns from the road in front of the position, which prove that the sensor sees in that direction."""


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
    """A second box beside a parked car: the rays there hit the parked car, which is another object."""
    found = after(camera_car(range_m), Rays(returns(range_m + 0.5), cluster=3))
    assert found.existence is not None
    assert (found.existence > 0.5) == exists
    said = [(each.value, each.limit, each.passed) for each in found.gates if each.name == "own_returns"]
    assert said == ([] if exists else [(0.0, 3, False)])


@pytest.mark.parametrize(
    ("seconds", "exists"), [pytest.param(1.0, True, id="was followed"), pytest.param(0.1, False, id="for one sweep")]
)
def test_a_lead_whose_cluster_was_joined_with_its_neighbours_is_still_there(seconds: float, exists: bool) -> None:
    """A van that the LiDAR tracked stops beside a parked car: their points form one cluster, that of the parked car. A
    box that was joined with a cluster only once is not such a van."""
    van, rays = camera_car(8.0), Rays(returns(8.5), cluster=3)
    ranged = replace(van, source="VL", seen_by="VL")
    state = ExistenceState({van.id: Existence(0.8, 0.0)})
    for _ in range(round(seconds / 0.1)):
        state, _ = weigh(state, (ranged,), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(10):
        state, (found,) = weigh(state, (van,), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


@pytest.mark.parametrize(
    ("number", "exists"), [pytest.param(7, False, id="its own"), pytest.param(9, True, id="another: may have merged")]
)
def test_a_box_whose_own_cluster_goes_on_without_it_is_misplaced(number: int, exists: bool) -> None:
    """A truck that overtakes: the image's edge cuts off most of it, so its box no longer matches its long flank."""
    truck, rays = camera_car(8.0), Rays(returns(8.5), cluster=3)
    ranged = replace(truck, source="VL", seen_by="VL", lidar_track=7)
    flank = replace(fused(2, 8.5, source="L"), lidar_track=number)
    state = ExistenceState({truck.id: Existence(0.8, 0.0)})
    for _ in range(10):
        state, _ = weigh(state, (ranged,), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(5):
        state, (found, _) = weigh(state, (truck, flank), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


@pytest.mark.parametrize(("number", "exists"), [(1, True), (2, False)], ids=["the object's", "a number of its own"])
def test_what_the_lidar_followed_under_another_number_has_not_merged(number: int, exists: bool) -> None:
    """An oncoming van, whose box jumps to a second one on it. The van keeps its number, and the box gets a new one."""
    van, rays = replace(camera_car(8.0), vision_track=7), Rays(returns(8.5), cluster=3)
    state = ExistenceState()
    for _ in range(10):
        state, _ = weigh(state, (replace(van, source="VL", seen_by="VL"),), rays, FRAME, moment(None, 0.1), PARAMS)
    for _ in range(10):
        state, (found,) = weigh(state, (replace(van, id=number),), rays, FRAME, moment(None, 0.1), PARAMS)
    assert found.existence is not None
    assert (found.existence > 0.5) == exists


def test_rays_start_at_the_sensor() -> None:
    """A ray from the roof passes over the position, although its return behind is at body height."""
    high = Rays(returns(40.0, height_m=0.6), origin=(0.0, 0.0, 3.0))
    assert gate(after(camera_car(), high)) is None
    assert gate(after(camera_car(), Rays(returns(40.0, height_m=0.6)))) is False


def test_a_vague_distance_needs_rays_through_all_of_it() -> None:
    """At 12 ± 1.2 m with a wall at 18 m, the car cannot exist. At 12 ± 4 m, it may be the wall."""
    wall = Rays(returns(18.0))
    assert gate(after(camera_car(sigma_m=1.2), wall)) is False
    assert gate(after(camera_car(sigma_m=4.0), wall)) is True


def test_what_stands_a_little_farther_away_than_its_box_says_may_be_the_car() -> None:
    """At 12 ± 1.2 m, the car cannot be at 18 m, but perhaps at 16.5 m. The road farther away is no car."""
    wall, road = after(camera_car(), Rays(returns(16.5))), after(camera_car(), Rays(returns(40.0, height_m=0.0)))
    assert (gate(wall), wall.existence) == (None, after(camera_car(), Rays(NOTHING)).existence)
    assert gate(road) is False


def test_missing_returns_say_nothing_of_a_car_that_may_be_too_far() -> None:
    missing = Rays(np.concatenate([ASIDE, TARMAC]))
    assert gate(after(camera_car(27.0, sigma_m=1.0), missing)) is False
    assert gate(after(camera_car(27.0, sigma_m=2.7), missing)) is None
    assert gate(after(camera_car(29.5, sigma_m=0.3), missing)) is False
    assert gate(after(camera_car(32.0, sigma_m=0.3), missing)) is None, "the LiDAR followed it out of its reach"


def test_rays_that_end_somewhere_in_a_vague_distance_do_not_speak_for_it() -> None:
    """A weak box at 40 ± 8 m and a hedge at 35 m."""
    weak = camera_car(40.0, sigma_m=8.0, score=0.35)
    assert after(weak, Rays(returns(35.0)), frames=20).existence == after(weak, Rays(NOTHING)).existence


@pytest.mark.parametrize(("count", "exists"), [(0, False), (2, False), (3, True)])
def test_what_returns_several_rays_is_there_though_others_pass_over_it(count: int, exists: bool) -> None:
    """Beyond a crest the road is lower than it seems, so rays that pass over a vehicle seem to pass through it."""
    found = after(replace(camera_car(28.0), returns=count), Rays(returns(60.0)))
    assert found.existence is not None
    assert (found.existence > 0.5) is exists
