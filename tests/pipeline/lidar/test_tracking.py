"""LiDAR tracks: identity, speed, carrying and dropping."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.geometry import Cuboid
from pipeline.ego_motion import frame_change
from pipeline.lidar.tracking import LidarTrackerState, looks, track
from pipeline.params import LidarTrackingParams
from pipeline.types import EgoState, LidarTrack, Obstacle

FILTERS = ("kalman", "trajectory")
STEADY = frame_change.between(EgoState(0, 10.0, 0.0), EgoState(0, 10.0, 0.0), 0.1)


def _car(x: float, y: float = 0.0, *, points: int = 40, length_m: float = 0.3, yaw_rad: float = 0.0) -> Obstacle:
    """A vehicle whose rear is at x."""
    return Obstacle(
        0, Cuboid((x + length_m / 2, y, 0.0), (length_m, 1.8, 1.5), yaw_rad), (x, y, 0.0), points, 75.0, (0.1, 0.5, 0.4)
    )


def _drive(
    ticks: Sequence[tuple[Obstacle, ...] | None], params: LidarTrackingParams, dt_s: float = 0.1
) -> list[tuple[LidarTrack, ...]]:
    state, out = LidarTrackerState(), []
    for k, obstacles in enumerate(ticks):
        state, tracks = track(state, obstacles, None if k == 0 else dt_s, params)
        out.append(tracks)
    return out


@pytest.mark.parametrize("filter_name", FILTERS)
@pytest.mark.parametrize("dt_s", [0.1, 0.3])
def test_a_steady_lead_keeps_its_number_and_its_velocity_is_found_at_any_rate(filter_name: str, dt_s: float) -> None:
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    seen = _drive([(_car(30.0 - 3.0 * k * dt_s, 0.1 * k * dt_s),) for k in range(20)], params, dt_s)
    assert [t.id for tracks in seen for t in tracks] == [1] * 20
    assert seen[0][0].velocity_mps is None
    assert seen[1][0].velocity_mps is not None
    assert seen[-1][0].velocity_mps == pytest.approx((-3.0, 0.1), abs=0.1)
    assert [tracks[0].hits for tracks in seen] == list(range(1, 21))


@pytest.mark.parametrize("filter_name", FILTERS)
def test_a_standing_car_met_at_100_kmh_is_one_track(filter_name: str) -> None:
    """It moves 2.8 m between sweeps, more than the gate of a track whose velocity is known."""
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    seen = _drive([(_car(35.0 - 2.78 * k),) for k in range(8)], params)
    assert [t.id for tracks in seen for t in tracks] == [1] * 8
    assert seen[-1][0].velocity_mps == pytest.approx((-27.8, 0.0), abs=1.5)


@pytest.mark.parametrize("filter_name", FILTERS)
def test_a_missed_track_is_carried_along_its_velocity_then_ends(filter_name: str) -> None:
    params = LidarTrackingParams(filter=filter_name, max_missed_s=0.3)  # type: ignore[arg-type]
    seen = _drive([*[(_car(20.0 + 0.5 * k, 1.0),) for k in range(10)], (), (), (), ()], params)
    for missed, (carried,) in enumerate(seen[10:13], start=1):
        assert (carried.carried, carried.missed, carried.hits) == (True, missed, 10)
        assert carried.obstacle.closest_point[0] == pytest.approx(24.5 + 0.5 * missed, abs=0.1)
        assert carried.obstacle.cluster == -1
    assert seen[13] == ()


@pytest.mark.parametrize("filter_name", FILTERS)
def test_after_a_gap_the_same_object_has_the_same_number(filter_name: str) -> None:
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    cars = [(_car(40.0 - k),) for k in range(14)]
    seen = _drive([*cars[:8], (), (), (), *cars[11:]], params)
    assert [t.id for tracks in seen for t in tracks] == [1] * 14
    assert [tracks[0].carried for tracks in seen[7:12]] == [False, True, True, True, False]


def test_a_barely_known_track_ends_with_a_sweep_that_lacks_it_but_not_without_a_sweep() -> None:
    params = LidarTrackingParams(carry_hits=3)
    ghosts = _drive([(_car(20.0),), (_car(20.1),), ()], params)
    assert ghosts[-1] == ()
    dark = _drive([(_car(20.0),), (_car(20.1),), None], params)
    assert [(t.id, t.carried) for t in dark[-1]] == [(1, True)]


def test_without_a_sweep_everything_is_predicted_and_ends_in_time() -> None:
    params = LidarTrackingParams(max_missed_s=0.2)
    seen = _drive([*[(_car(20.0 - k), _car(30.0, 5.0)) for k in range(6)], None, None, None], params)
    assert [[t.id for t in tracks] for tracks in seen[6:]] == [[1, 2], [1, 2], []]
    assert seen[7][0].obstacle.closest_point[0] == pytest.approx(13.0, abs=0.2)


GATES: dict[str, tuple[Obstacle, Obstacle, Callable[[LidarTrackingParams], LidarTrackingParams]]] = {
    "place": (_car(20.0), _car(25.0), lambda p: p.model_copy(update={"gate_m": 10.0})),
    "count": (_car(20.0), _car(20.0, points=400), lambda p: p.model_copy(update={"max_count_ratio": 20.0})),
    "density": (
        _car(20.0),
        _car(20.0)._replace(density=750.0),
        lambda p: p.model_copy(update={"max_density_ratio": 50.0}),
    ),
    "spread": (
        _car(20.0),
        _car(20.0)._replace(spread=(3.0, 0.5, 0.4)),
        lambda p: p.model_copy(update={"max_spread_change_m": 5.0}),
    ),
}


@pytest.mark.parametrize("name", GATES)
def test_each_gate_makes_another_object_of_it_and_opening_the_gate_does_not(name: str) -> None:
    before, after, opened = GATES[name]
    params = LidarTrackingParams(max_missed_s=0.0)
    assert [t.id for t in _drive([(before,), (after,)], params)[-1]] == [2]
    assert [t.id for t in _drive([(before,), (after,)], opened(params))[-1]] == [1]


def test_a_few_points_more_or_less_are_no_other_object() -> None:
    """One ring more or less changes the number of points on a far car by a factor of two."""
    seen = _drive([(_car(35.0, points=2),), (_car(35.0, points=10),)], LidarTrackingParams())
    assert [t.id for t in seen[-1]] == [1]


def test_least_total_distance_one_to_one() -> None:
    """Taking the nearest pair first would leave the other track with a partner outside its gate."""
    params = LidarTrackingParams(gate_m=1.3, start_speed_mps=1.0, max_missed_s=0.0)
    seen = _drive([(_car(20.0), _car(21.0)), (_car(20.7), _car(21.5))], params)
    assert [(t.id, t.obstacle.closest_point[0]) for t in seen[-1]] == [(1, 20.7), (2, 21.5)]


def test_a_lead_does_not_swap_its_track_with_a_parked_car_that_looks_different_now() -> None:
    """The lead drives 1.7 m ahead of where a parked car comes out from behind another. Two tracks with the obstacle of
    the other would be two pairs, but one track with its own and one without are nearer to the truth."""
    lead = _car(15.9)._replace(density=17.0)
    hidden, parked = _car(17.4, -1.8)._replace(density=4.0), _car(16.6, -1.8)._replace(density=30.0)
    seen = _drive([(lead, hidden), (lead, parked)], LidarTrackingParams())
    assert {t.id: t.obstacle.closest_point for t in seen[-1] if not t.carried} == {
        1: (15.9, 0.0, 0.0),
        3: (16.6, -1.8, 0.0),
    }


def test_numbers_are_never_given_twice_and_the_first_tick_forgets() -> None:
    params = LidarTrackingParams()
    state, _ = track(LidarTrackerState(), (_car(10.0), _car(20.0)), None, params)
    state, tracks = track(state, (_car(10.0),), None, params)
    assert [t.id for t in tracks] == [3]
    assert state.next_id == 4


def test_the_filter_may_be_changed_between_two_frames() -> None:
    state = LidarTrackerState()
    for k in range(12):
        params = LidarTrackingParams(filter=FILTERS[k % 2])  # type: ignore[arg-type]
        state, tracks = track(state, (_car(30.0 - 0.2 * k),), None if k == 0 else 0.1, params)
        assert [t.id for t in tracks] == [1]
    assert tracks[0].velocity_mps == pytest.approx((-2.0, 0.0), abs=0.2)


@pytest.mark.parametrize(
    ("cuboid", "expected"),
    [
        (Cuboid((20.0, 1.0, 0.0), (4.0, 1.8, 1.5), 0.0), (18.0, 1.0)),
        (Cuboid((20.0, 1.0, 0.0), (4.0, 1.8, 1.5), np.pi / 2), (19.1, 1.0)),
        (Cuboid((20.0, 1.0, 0.0), (4.0, 2.0, 1.5), np.pi / 6), (20 - 2 * np.cos(np.pi / 6), 1 - 1.0)),
        (Cuboid((20.0, 1.0, 0.0), (4.0, 2.0, 1.5), -np.pi / 3), (20 - np.cos(np.pi / 6), 1 - 0.5)),
    ],
    ids=["ahead", "crossing", "turned left", "mostly across"],
)
def test_what_is_followed_is_the_middle_of_the_rear(cuboid: Cuboid, expected: tuple[float, float]) -> None:
    (found,) = looks((_car(0.0)._replace(cuboid=cuboid),)).place
    assert found == pytest.approx(expected)


def test_a_flank_coming_into_view_is_no_motion() -> None:
    """This is why the rear is tracked: the centre would jump by 2 m here."""
    lengths = [0.3] * 6 + [4.3] * 3
    params = LidarTrackingParams(max_spread_change_m=5.0)
    seen = _drive([(_car(15.0, length_m=length),) for length in lengths], params)
    assert [t.id for tracks in seen for t in tracks] == [1] * 9
    assert seen[-1][0].velocity_mps == pytest.approx((0.0, 0.0), abs=0.05)


@given(
    st.lists(
        st.one_of(
            st.none(),
            st.lists(st.tuples(st.floats(1, 60), st.floats(-10, 10), st.integers(1, 500)), max_size=6),
        ),
        max_size=8,
    ),
    st.sampled_from(FILTERS),
    st.floats(0.0, 1.0),
)
def test_every_obstacle_is_in_exactly_one_track(
    ticks: list[list[tuple[float, float, int]] | None], filter_name: str, dt_s: float
) -> None:
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    obstacles = [None if tick is None else tuple(_car(x, y, points=n) for x, y, n in tick) for tick in ticks]
    for given_now, tracks in zip(obstacles, _drive(obstacles, params, dt_s), strict=True):
        seen = [t.obstacle for t in tracks if not t.carried]
        assert sorted(map(id, seen)) == sorted(map(id, given_now or ()))
        assert [t.id for t in tracks] == sorted({t.id for t in tracks})
        assert all(t.missed == 0 for t in tracks if not t.carried)


@pytest.mark.parametrize("filter_name", FILTERS)
def test_a_rear_with_and_without_a_bit_of_flank_is_one_car(filter_name: str) -> None:
    """The side changes the footprint, and with it the density, by a factor of twenty."""
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    thin, thick = (
        _car(20.0, length_m=length)._replace(density=24 / (1.8 * length), points=24) for length in (0.1, 1.5)
    )
    seen = _drive([(thin,), (thick,), (thin,), (thick,)], params)
    assert [t.id for tracks in seen for t in tracks] == [1] * 4


@pytest.mark.parametrize("speed_mps", [10.0, 9.0], ids=["steady", "braking hard"])
def test_a_missed_track_comes_nearer_as_fast_as_the_car_now_drives(speed_mps: float) -> None:
    params = LidarTrackingParams()
    state = LidarTrackerState()
    for k in range(10):
        state, _ = track(state, (_car(34.0 - k),), None if k == 0 else 0.1, params, STEADY if k else None)
    braked = frame_change.between(EgoState(0, 10.0, 0.0), EgoState(0, speed_mps, 0.0), 0.1)
    steady = frame_change.between(EgoState(0, speed_mps, 0.0), EgoState(0, speed_mps, 0.0), 0.1)
    state, _ = track(state, (), 0.1, params, braked)
    state, (carried,) = track(state, None, 0.1, params, steady)
    state, (carried,) = track(state, None, 0.1, params, steady)
    assert carried.carried
    assert carried.velocity_mps == pytest.approx((-speed_mps, 0.0), abs=0.1)
    assert carried.obstacle.closest_point[0] == pytest.approx(
        25.0 - (10.0 + speed_mps) / 20.0 - speed_mps / 5.0, abs=0.1
    )


@pytest.mark.parametrize("filter_name", FILTERS)
def test_a_velocity_is_known_better_with_each_sighting_and_worse_while_it_is_not_seen(filter_name: str) -> None:
    params = LidarTrackingParams(filter=filter_name)  # type: ignore[arg-type]
    seen = _drive([*((_car(30.0 - 0.3 * k),) for k in range(20)), (), ()], params)
    first, *later = (tracks[0].speed_sigma_mps for tracks in seen)
    assert first is None, "one sighting says nothing"
    known = [sigma for sigma in later if sigma is not None]
    assert len(known) == 21
    assert known[0] > 1.0 > known[2] > known[18]
    assert known[18] == pytest.approx(0.49, abs=0.01), "3 m/s² for 0.1 s at a time, positions to 0.15 m"
    assert known[18] < known[19] < known[20]
