"""A car placed on a route by its receiver: where the route lies ahead, how sure that is, and what breaks it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from pipeline.params import PathParams
from pipeline.path import route_following
from pipeline.path.estimates import PathEstimate
from pipeline.path.route_following import GnssState
from pipeline.path.route_line import lay_out, to_grid, utm_zone
from pipeline.simulation.sensors import gnss as receiver
from pipeline.simulation.sensors.gnss_model import GnssModel
from pipeline.types import F64, EgoState, GnssFix, Route

PARAMS = PathParams()
LAT, LON = 48.1, 11.2
SPEED = 20.0


def place(east_m: float, north_m: float, lat: float = LAT, lon: float = LON) -> tuple[float, float]:
    return receiver.from_local(np.array([east_m, north_m, 0.0]), lat, lon, 0.0)[:2]


def bend(radius_m: float, length_m: float = 600.0, lat: float = LAT, lon: float = LON) -> Route:
    """Due north, then a bend to the left from 100 m on."""
    s = np.arange(-50.0, length_m, 2.0)
    turn = np.maximum(s - 100.0, 0.0) / radius_m
    north = np.minimum(s, 100.0) + radius_m * np.sin(turn)
    west = radius_m * (1.0 - np.cos(turn))
    rows = np.array([place(-w, n, lat, lon) for w, n in zip(west, north, strict=True)])
    return Route("bend", rows[:, 0], rows[:, 1], 0.02)


def fix(t_s: float, north_m: float, east_m: float = 0.0, sigma_m: float = 0.02, **where: float) -> GnssFix:
    lat, lon = place(east_m, north_m, **where)
    return GnssFix(round(t_s * 1e9), lat, lon, 0.0, 0.0, SPEED, "rtk_fixed", sigma_m)


def drive(
    fixes: list[GnssFix | None], route: Route, yaw: float | None = 0.0
) -> tuple[GnssState, PathEstimate | None, list[str]]:
    """Ten frames a second at 20 m/s due north, one fix each."""
    state, path, said = GnssState(), None, []
    for k, each in enumerate(fixes):
        t_ns = k * 100_000_000
        state, notes = route_following.follow(
            state, route, each, EgoState(t_ns, SPEED, yaw), t_ns, 0.1 if k else None, PARAMS
        )
        state, path, more = route_following.ahead(state, PARAMS)
        said += [*notes, *more]
    return state, path, said


def north_bound(count: int, **options: float) -> list[GnssFix | None]:
    return [fix(0.1 * k, 2.0 * k, **options) for k in range(count)]


@pytest.mark.parametrize(
    ("lat", "lon"),
    [(LAT, LON), (-33.9, 18.4), (60.0, 5.9), (0.5, -179.9)],
    ids=["Munich", "south", "zone edge", "date"],
)
def test_the_route_lies_ahead_in_the_ego_frame(lat: float, lon: float) -> None:
    """After 3 s at 20 m/s, the car is 40 m before the bend. Grid north differs from true north by up to 3°: a path that
    confuses them is wrong by 5 m at 100 m."""
    where = {"lat": lat, "lon": lon}
    _, path, said = drive(north_bound(31, **where), bend(125.0, **where))
    assert not said
    assert path is not None
    assert path.center[40] == pytest.approx([40.0, 0.0], abs=0.1)
    theta = 60.0 / 125.0
    assert path.center[100] == pytest.approx([40.0 + 125.0 * math.sin(theta), 125.0 * (1 - math.cos(theta))], abs=0.3)
    assert path.sigma_m[0] < 0.1
    assert path.sigma_m[100] > path.sigma_m[10] > path.sigma_m[0]


def test_offset_in_the_lane_shows() -> None:
    """A car half a metre east of a route that leads north has the route half a metre to its left."""
    _, path, _ = drive(north_bound(20, east_m=0.5), bend(500.0))
    assert path is not None
    assert path.center[0] == pytest.approx([0.0, 0.5], abs=0.03)


def test_a_worse_receiver_makes_a_less_sure_path() -> None:
    paths = [drive(north_bound(20, sigma_m=sigma), bend(500.0))[1] for sigma in (0.02, 0.3, 2.0)]
    sigmas = [path.sigma_m[30] for path in paths if path is not None]
    assert sigmas[0] < 0.3 < sigmas[1] < 1.0 < 2.0 <= sigmas[2]


def test_loss_of_fix_goes_on_by_dead_reckoning_and_gets_less_sure() -> None:
    known = north_bound(20)
    _, sure, _ = drive(known, bend(125.0))
    _, unsure, said = drive([*known, *[None] * 20], bend(125.0))
    assert sure is not None
    assert unsure is not None
    assert not said
    # 2 s and 40 m later; the bend that began at 62 m begins at 22 m
    assert unsure.center[20] == pytest.approx([20.0, 0.0], abs=0.2)
    assert unsure.center[60, 1] == pytest.approx(125.0 * (1 - math.cos(38.0 / 125.0)), abs=0.4)
    assert unsure.sigma_m[0] > sure.sigma_m[0]
    assert unsure.sigma_m[60] > 1.2 * sure.sigma_m[60]
    _, lost, said = drive([*known, *[None] * 400], bend(4000.0, 1500.0))
    assert lost is None or lost.sigma_m[30] > 1.0


def test_a_jump_lowers_confidence_and_does_not_move_the_path() -> None:
    known = north_bound(20)
    jumped = [*known, fix(2.0, 40.0, 5.0)]
    _, before, _ = drive([*known, fix(2.0, 40.0)], bend(500.0))
    _, after, said = drive(jumped, bend(500.0))
    assert before is not None
    assert after is not None
    assert said == ["GNSS jumped by 5.0 m: fix ignored"]
    assert np.abs(after.center - before.center)[:60].max() < 0.2
    assert np.all(after.sigma_m > 0.99 * PARAMS.lane_keeping_sigma_m), "no surer of the lane than any car is"
    assert np.all(after.sigma_m > before.sigma_m + 0.1)
    # the bend begins 60 m ahead, or somewhere within 5 m of there
    assert after.sigma_m[100] ** 2 - before.sigma_m[100] ** 2 > (4.9 * math.sin(40.0 / 500.0)) ** 2


def test_a_jump_that_stays_is_doubted_for_long() -> None:
    """Two seconds of fixes 5 m to the right: either the pose was wrong, or the receiver is. The route still gives the
    curvature; that it lies 5 m to the left is as uncertain as that the car keeps its lane."""
    fixes = [*north_bound(20), *[fix(0.1 * k, 2.0 * k, 5.0) for k in range(20, 45)]]
    state, path, said = drive(fixes, bend(250.0))
    _, straight_on, _ = drive(north_bound(45), bend(250.0))
    assert path is not None
    assert straight_on is not None
    assert np.abs(path.center - straight_on.center)[:60].max() < 0.3
    assert PARAMS.lane_keeping_sigma_m * 0.99 < path.sigma_m[0] < 1.0
    assert state.placed_anew
    assert 4.0 < state.doubt_m < 5.0
    assert sum(each == "GNSS jumped by 5.0 m: fix ignored" for each in said) == 19
    assert said[-1] == "GNSS position reset after a jump, uncertain by 5.0 m: too inaccurate to tell the lane"


def test_the_doubt_of_a_jump_ends() -> None:
    fixes = [*north_bound(20), *[fix(0.1 * k, 2.0 * k, 5.0) for k in range(20, 2000)]]
    state, path, said = drive(fixes, bend(1e9, 4100.0))
    assert not state.placed_anew
    assert said[-1].startswith("GNSS position reset after a jump, uncertain by 0.3 m")
    assert path is not None
    assert path.center[0, 1] > 3.5, "the place counts again"


@pytest.mark.parametrize(
    ("fixes", "sentence"),
    [
        pytest.param(north_bound(10, east_m=40.0), "the car is off the route", id="on another road"),
        pytest.param([None] * 10, "no GNSS fix yet to locate the car on the route", id="no fix at all"),
        pytest.param(
            [dataclasses.replace(each, course_rad=math.pi) for each in north_bound(10) if each],
            "the car is off the route",
            id="the other way round",
        ),
        pytest.param(
            [dataclasses.replace(each, lat_deg=math.nan) for each in north_bound(10) if each],
            "no GNSS fix yet to locate the car on the route",
            id="not a number",
        ),
    ],
)
def test_off_the_route_it_says_so(fixes: list[GnssFix | None], sentence: str) -> None:
    _, path, said = drive(fixes, bend(500.0))
    assert path is None
    assert said[-1] == sentence


def test_where_the_route_ends_nothing_is_known() -> None:
    _, path, _ = drive(north_bound(31), bend(500.0, 102.0))
    assert path is not None
    assert path.sigma_m[35] < 1.0
    assert path.sigma_m[60] > 100.0
    assert np.all(np.hypot(*np.diff(path.center, axis=0).T) > 0.5), "its points stay apart"


@pytest.mark.parametrize(
    "rows",
    [
        pytest.param(np.zeros((0, 2)), id="empty"),
        pytest.param(np.full((5, 2), 48.0), id="one place, five times"),
        pytest.param(np.full((5, 2), np.nan), id="not numbers"),
    ],
)
def test_a_route_without_a_line_is_told(rows: F64) -> None:
    route = Route("empty", rows[:, 0], rows[:, 1], 0.1)
    assert lay_out(route) is None
    _, path, said = drive(north_bound(3), route)
    assert path is None
    assert said[0] == "route empty contains no line"


def test_scatter_of_a_recorded_route_is_smoothed() -> None:
    rng = np.random.default_rng(3)
    true = bend(250.0)
    off = rng.normal(0.0, 0.3, (2, len(true.lat_deg))) / 111_000.0
    line = lay_out(Route("recorded", true.lat_deg + off[0], true.lon_deg + off[1] / math.cos(math.radians(LAT)), 0.3))
    clean = lay_out(true)
    assert line is not None
    assert clean is not None
    inside = slice(60, 400)
    assert np.abs(np.diff(line.headings[inside])).max() < 0.05
    nearest = [np.hypot(*(clean.places - point).T).min() for point in line.places[inside]]
    assert max(nearest) < 0.6


def test_the_same_route_is_laid_out_once() -> None:
    route = bend(500.0)
    state, _, _ = drive(north_bound(3), route)
    again, _ = route_following.follow(state, bend(500.0), None, EgoState(3, SPEED, 0.0), 300_000_000, 0.1, PARAMS)
    assert again.line is state.line


def test_zones_and_convergence() -> None:
    assert utm_zone(48.1, 11.2) == 32632
    assert utm_zone(-33.9, 18.4) == 32734
    _, _, convergence = to_grid(32632, 48.1, 11.2)
    ahead, behind = (np.array(to_grid(32632, 48.1 + step, 11.2)[:2]) for step in (1e-4, -1e-4))
    east, north = ahead - behind
    assert convergence == pytest.approx(-math.atan2(east, north), abs=1e-5), "true north on the grid, by differences"


def test_the_simulators_receiver_and_the_route_agree() -> None:
    """The simulator places its world on the ellipsoid without UTM; converting back by UTM agrees to a centimetre."""
    model = GnssModel(x_axis_deg=30.0)
    rows = [receiver.from_local(np.array([e, 2.0 * e, 0.0]), model.lat_deg, model.lon_deg, 0.0) for e in (0.0, 100.0)]
    (x0, y0, _), (x1, y1, _) = (to_grid(32652, lat, lon) for lat, lon, _ in rows)
    assert math.hypot(x1 - x0, y1 - y0) == pytest.approx(math.hypot(100.0, 200.0), rel=1e-3)
