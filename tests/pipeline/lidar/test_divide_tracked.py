"""Clusters that cover two tracked vehicles are divided between them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common import kalman
from pipeline.common.geometry import Cuboid
from pipeline.lidar.cluster import cluster
from pipeline.lidar.divide_tracked import MIN_HITS, divide
from pipeline.params import ClusterParams
from pipeline.types import F32, F64, I32, LidarTrack, Obstacle

DT_S = 0.1
PARAMS = ClusterParams()
STANDS, DRIVES = (-7.0, 0.0), (-1.0, 0.0)
"""Relative to a car at 7 m/s."""


def wall(start: tuple[float, float], end: tuple[float, float], step_m: float = 0.08) -> F32:
    """Returns of two rings along an upright surface."""
    count = int(np.hypot(end[0] - start[0], end[1] - start[1]) / step_m) + 1
    xy = np.linspace(start, end, count)
    rings = [np.column_stack([xy, np.full((count, 1), z), np.zeros((count, 1))]) for z in (-0.8, -0.4)]
    return np.vstack(rings).astype(np.float32)


def track(
    number: int, rear: tuple[float, float], size: tuple[float, float], velocity: tuple[float, float], hits: int = 10
) -> LidarTrack:
    """The track of the previous sweep. rear: x of the near side and y of its centre, now. size: length, width."""
    x, y = rear[0] + size[0] / 2 - velocity[0] * DT_S, rear[1] - velocity[1] * DT_S
    cuboid = Cuboid((x, y, -0.6), (*size, 1.5), 0.0)
    return LidarTrack(number, Obstacle(0, cuboid, (x, y, -0.6), 50, 10.0, (1.0, 1.0, 1.0)), velocity, hits, 0, False)


def filters(count: int, speed_sigma: float = 0.2) -> kalman.CvState:
    return kalman.CvState(
        np.zeros((count, 4)), np.tile(np.diag([0.1, 0.1, speed_sigma, speed_sigma]) ** 2, (count, 1, 1))
    )


def sightings(tracks: list[LidarTrack]) -> F64:
    """(T, 10, 5) sightings of the last second: the current ones, moved by their velocities."""
    history = np.empty((len(tracks), 10, 5))
    for each, rows in zip(tracks, history, strict=True):
        ago_s = np.arange(9, -1, -1) * DT_S
        x, y = each.obstacle.cuboid.center[:2]
        half = each.obstacle.cuboid.size[1] / 2
        assert each.velocity_mps is not None
        vx, vy = each.velocity_mps
        rows[:] = np.column_stack([-ago_s, x - vx * ago_s, *(y + dy - vy * ago_s for dy in (0.0, -half, half))])
    return history


def divided(
    points: F32,
    tracks: list[LidarTrack],
    params: ClusterParams = PARAMS,
    dt_s: float | None = DT_S,
    speed_sigma: float = 0.2,
    history: F64 | None = None,
) -> tuple[I32, I32]:
    """Labels before and after."""
    before = cluster(points, np.ones(len(points), dtype=np.bool_), params)
    seen = sightings(tracks) if history is None else history
    return before, divide(points, before, tracks, filters(len(tracks), speed_sigma), seen, dt_s, params)


LEAD, PARKED = wall((12.0, -1.0), (12.0, 1.0)), wall((10.0, -3.5), (10.0, -1.6))
FLANK = wall((10.1, -1.6), (13.5, -1.6))
BESIDE = np.vstack([LEAD, PARKED, FLANK])
"""A lead's rear, and a parked car 0.6 m beside it whose side has come into view."""
LEAD_TRACK, PARKED_TRACK = ((12.0, 0.0), (0.1, 2.0)), ((10.0, -2.55), (1.0, 1.9))


@pytest.mark.parametrize(
    ("what", "lead_velocity"), [("the lead drives", DRIVES), ("both stand, wider than any vehicle", STANDS)]
)
def test_a_lead_and_the_parked_car_beside_it_are_two(what: str, lead_velocity: tuple[float, float]):
    tracks = [track(1, *LEAD_TRACK, lead_velocity), track(2, *PARKED_TRACK, STANDS)]
    before, after = divided(BESIDE, tracks)
    assert set(before) == {0}, "the clusters touch"
    assert set(after[: len(LEAD)]) == {0}
    assert set(after[len(LEAD) :]) == {1}, "the flank is the parked car's, though parts of it are nearer to the lead"


def test_a_flank_that_was_joined_with_the_lead_comes_home():
    """The parked car's rear has its own cluster; of its side, only the part beside the lead was seen."""
    flank = wall((11.8, -1.6), (12.2, -1.6))
    points = np.vstack([LEAD, flank, PARKED])
    tracks = [track(1, *LEAD_TRACK, DRIVES), track(2, (10.0, -2.55), (2.5, 1.8), STANDS)]
    before, after = divided(points, tracks)
    home = before[-1]
    assert before[len(LEAD)] == before[0] != home
    assert set(after[len(LEAD) : len(LEAD) + len(flank)]) == {after[-1]}
    assert set(after[: len(LEAD)]) == {after[0]} != {after[-1]}


@pytest.mark.parametrize(
    "tracks",
    [
        [track(1, *LEAD_TRACK, DRIVES)],
        [track(2, *PARKED_TRACK, STANDS)],
        [track(1, *LEAD_TRACK, DRIVES, hits=MIN_HITS - 1), track(2, *PARKED_TRACK, STANDS)],
        [track(1, *LEAD_TRACK, DRIVES), track(2, (20.0, -2.55), (1.0, 1.9), STANDS)],
    ],
    ids=["the lead alone is known", "the parked car alone is known", "the lead is new", "the other one is elsewhere"],
)
def test_what_a_known_vehicle_cannot_have_grown_by_is_something_else(tracks: list[LidarTrack]):
    before, after = divided(BESIDE, tracks)
    assert set(before) == {0}, "the clusters touch"
    assert set(after[: len(LEAD)]) == {0}
    assert set(after[len(LEAD) :]) == {1}


@pytest.mark.parametrize(
    ("lead_velocity", "params", "parts"),
    [
        pytest.param(DRIVES, PARAMS, 2, id="a lead, which ends at its rear"),
        pytest.param(DRIVES, ClusterParams(divide_nearer=False), 1, id="a lead, switched off"),
        pytest.param(STANDS, PARAMS, 1, id="may show a new side"),
    ],
)
def test_what_is_nearer_than_a_lead_is_something_else(
    lead_velocity: tuple[float, float], params: ClusterParams, parts: int
):
    """A parked car comes up beside it, and both together are no wider than a vehicle. Its flank was joined with the
    lead before, so that the lead's side is not known to be less far to the right."""
    lead, flank = wall((14.2, -1.2), (14.2, 0.4)), wall((12.0, -1.8), (14.0, -1.8), 0.4)
    before, after = divided(np.vstack([lead, flank]), [track(1, (14.2, -0.7), (1.0, 2.2), lead_velocity)], params)
    assert set(before) == {0}, "the clusters touch"
    assert set(after[: len(lead)]) == {0}
    assert len(set(after)) == parts


def test_what_no_track_follows_yet_stays_where_it_is():
    """It does not go to any other cluster, wherever it is."""
    elsewhere = wall((8.0, 6.0), (8.0, 7.5))
    tracks = [track(1, (8.0, 6.75), (0.1, 1.5), STANDS), track(2, *LEAD_TRACK, DRIVES)]
    _, after = divided(np.vstack([elsewhere, BESIDE]), tracks)
    assert set(after[: len(elsewhere)]) == {0}
    assert set(after[-len(PARKED) - len(FLANK) :]) == {2}


@pytest.mark.parametrize(
    ("sweeps", "by_m", "parts"),
    [
        pytest.param(2, 0.5, 2, id="two sweeps"),
        pytest.param(7, 0.7, 2, id="seven of ten, wider than any vehicle"),
        pytest.param(7, 0.5, 1, id="seven of ten, no wider than a vehicle may be"),
        pytest.param(9, 0.7, 1, id="nine of ten: it may be that wide"),
    ],
)
def test_sweeps_in_which_they_were_one_are_forgotten(sweeps: int, by_m: float, parts: int):
    """In the last sweeps, the lead's cluster included the side of a parked car that no track follows."""
    history = sightings([track(1, *LEAD_TRACK, DRIVES)])
    history[0, -sweeps:, 3] -= by_m
    _, after = divided(BESIDE, [track(1, (12.0, -0.3), (1.5, 2.6), DRIVES)], history=history)
    assert set(after[: len(LEAD)]) == {0}
    assert len(set(after)) == parts


SIDE = wall((15.0, -4.0), (15.0, 4.0))
UNDIVIDED = {
    "one long surface that was followed as two": (
        SIDE,
        [track(1, (15.0, -2.0), (0.1, 4.0), STANDS), track(2, (15.0, 2.0), (0.1, 4.0), STANDS)],
    ),
    "two halves of one car": (
        np.vstack([wall((10.0, -0.9), (10.0, 0.9)), wall((10.6, -0.9), (10.6, 0.9))]),
        [track(1, (10.0, 0.0), (0.1, 1.8), STANDS), track(2, (10.6, 0.0), (0.1, 1.8), STANDS)],
    ),
    "none is known for long": (BESIDE, [track(1, *LEAD_TRACK, DRIVES, hits=MIN_HITS - 1)]),
    "the only one was always as wide": (BESIDE, [track(1, (10.0, -1.25), (3.5, 4.5), STANDS)]),
    "the side of the only one comes into view": (
        np.vstack([LEAD, wall((12.0, 1.0), (14.0, 3.0))]),
        [track(1, *LEAD_TRACK, DRIVES)],
    ),
    "the only one and its mirror": (
        np.vstack([LEAD, wall((12.2, 1.25), (12.2, 1.25))]),
        [track(1, *LEAD_TRACK, DRIVES)],
    ),
    "the flank of the only one comes into view, with gaps": (
        np.vstack([LEAD, wall((12.5, 1.1), (13.9, 1.42), 0.7)]),
        [track(1, *LEAD_TRACK, DRIVES)],
    ),
}


@pytest.mark.parametrize("case", UNDIVIDED)
def test_what_may_be_one_stays_one(case: str):
    points, tracks = UNDIVIDED[case]
    before, after = divided(points, tracks)
    assert set(before) == set(after) == {0}


def test_few_returns_of_something_nearer_are_no_part_of_a_vehicle():
    """The first two returns of a parked car that a lead comes up to, which is not yet wider with them than a vehicle
    may be: too few for a cluster. They would widen the track, and count as returns of it in the next sweep."""
    nearer = wall((11.4, -1.5), (11.4, -1.5))
    points = np.vstack([LEAD, nearer])
    before, after = divided(points, [track(1, *LEAD_TRACK, (-6.0, 0.0))])
    assert set(before) == set(after[: len(LEAD)]) == {0}
    assert 0 < len(nearer) < PARAMS.min_points
    assert set(after[len(LEAD) :]) == {-1}


def test_a_vehicle_that_moves_sideways_has_not_left_its_extent_behind():
    """A lead steers away from a parked car that it passes, at 1 m/s: the last second's extent is half a metre aside."""
    history = sightings([track(1, *LEAD_TRACK, DRIVES)])
    history[0, :, 3:] -= (history[0, -1, 0] + DT_S - history[0, :, :1]) * 1.0
    beside = wall((12.0, -1.55), (12.0, -1.4))
    _, after = divided(np.vstack([LEAD, beside]), [track(1, (12.0, -0.25), (0.1, 2.5), DRIVES)], history=history)
    assert set(after[: len(LEAD)]) == {0}
    assert 0 not in after[len(LEAD) :]


def test_speeds_known_too_poorly_set_nothing_apart():
    """Two halves of one car, one of which seems to move at 3 ± 2 m/s."""
    points = np.vstack([wall((10.0, -0.9), (10.0, 0.9)), wall((10.6, -0.9), (10.6, 0.9))])
    tracks = [track(1, (10.0, 0.0), (0.1, 1.8), STANDS), track(2, (10.6, 0.0), (0.1, 1.8), (-4.0, 0.0))]
    unsure, sure = (divided(points, tracks, speed_sigma=sigma)[1] for sigma in (2.0, 0.2))
    assert (set(unsure), set(sure)) == ({0}, {0, 1})


@pytest.mark.parametrize(
    ("changes", "dt_s"), [({"divide_tracked": False}, DT_S), ({}, None)], ids=["switched off", "at a start"]
)
def test_without_it_or_without_a_sweep_before_nothing_is_divided(changes: dict[str, bool], dt_s: float | None):
    params = PARAMS.model_copy(update=changes)
    tracks = [track(1, *LEAD_TRACK, DRIVES), track(2, *PARKED_TRACK, STANDS)]
    before, after = divided(BESIDE, tracks, params, dt_s)
    assert after is before


@given(
    st.lists(st.tuples(st.floats(5, 20), st.floats(-4, 4)), min_size=1, max_size=60),
    st.lists(st.tuples(st.floats(5, 20), st.floats(-4, 4), st.floats(-10, 10)), max_size=5),
)
def test_every_clustered_point_keeps_a_cluster_and_no_other_gets_one(
    places: list[tuple[float, float]], known: list[tuple[float, float, float]]
):
    points = np.array([(x, y, -0.5, 0.0) for x, y in places], dtype=np.float32)
    tracks = [track(n, (x, y), (1.0, 1.8), (v, 0.0)) for n, (x, y, v) in enumerate(known)]
    before, after = divided(points, tracks)
    assert np.array_equal(before < 0, after < 0)
    assert set(after[after >= 0]) == set(range(int(after.max()) + 1))
    assert all(count >= PARAMS.min_points for count in np.bincount(after[after >= 0]))
