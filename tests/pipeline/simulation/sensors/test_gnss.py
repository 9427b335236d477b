"""The simulated receiver: places on the ellipsoid by the book, noise by the numbers, course by the compass."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.simulation.sensors import gnss
from pipeline.simulation.sensors.gnss_model import GnssModel
from pipeline.simulation.world import world_state
from pipeline.types import GnssFix
from tests.pipeline.simulation.worlds import with_actors

QUIET = {"sigma_m": 0.0, "sigma_up_m": 0.0, "sigma_speed_mps": 0.0, "sigma_course_deg": 0.0}


def fix_at(t_s: float, index: int = 0, seed: int = 1, speed: float = 20.0, **model: float) -> GnssFix:
    return gnss.fix(world_state.at(with_actors(speed=speed), t_s), GnssModel(**model), seed, index, 5)


@pytest.mark.parametrize(
    ("place", "earth"),
    [
        ((0.0, 0.0, 0.0), (6378137.0, 0.0, 0.0)),
        ((0.0, 90.0, 100.0), (0.0, 6378237.0, 0.0)),
        ((90.0, 0.0, 0.0), (0.0, 0.0, 6356752.314245)),
        ((45.0, 45.0, 0.0), (3194419.145061, 3194419.145061, 4487348.408866)),
    ],
)
def test_earth_coordinates(place: tuple[float, float, float], earth: tuple[float, float, float]) -> None:
    np.testing.assert_allclose(gnss.to_earth(*place), earth, atol=1e-3)


@given(
    st.floats(-80, 80), st.floats(-179, 179), st.floats(-100, 3000),
    st.floats(-9e3, 9e3), st.floats(-9e3, 9e3), st.floats(-50, 50),
)  # fmt: skip
def test_there_and_back(lat: float, lon: float, alt: float, east: float, north: float, up: float) -> None:
    place = gnss.from_local(np.array([east, north, up]), lat, lon, alt)
    away = gnss.to_earth(*place) - gnss.to_earth(lat, lon, alt)
    assert np.linalg.norm(away) == pytest.approx(np.linalg.norm([east, north, up]), abs=1e-3)


@pytest.mark.parametrize(
    ("x_axis_deg", "lat_sign", "lon_sign"), [(0.0, 1, 0), (90.0, 0, 1), (180.0, -1, 0), (270.0, 0, -1)]
)
def test_driving_along_x_goes_where_x_points(x_axis_deg: float, lat_sign: int, lon_sign: int) -> None:
    first, last = (fix_at(t, x_axis_deg=x_axis_deg, **QUIET) for t in (0.0, 5.0))
    north_m = (last.lat_deg - first.lat_deg) * 110_950.0  # a degree of latitude at 35.65°
    east_m = (last.lon_deg - first.lon_deg) * 90_540.0
    assert (north_m, east_m) == (pytest.approx(100.0 * lat_sign, abs=0.1), pytest.approx(100.0 * lon_sign, abs=0.1))
    assert last.course_rad is not None
    assert np.degrees(last.course_rad) % 360 == pytest.approx(x_axis_deg)
    assert (last.speed_mps, last.alt_m, last.t_ns) == (20.0, 40.0, 5)


def test_a_left_turn_counts_down_on_the_compass() -> None:
    scene = with_actors(segments="{length_m: 900, radius_m: 100}")
    courses = [gnss.fix(world_state.at(scene, t), GnssModel(**QUIET), 1, 0, 0).course_rad for t in (0.0, 1.0)]
    assert courses[0] is not None
    assert courses[1] is not None
    assert courses[1] < courses[0]


def test_noise_is_as_strong_as_said_and_repeats() -> None:
    fixes = [fix_at(0.0, index, sigma_m=0.02) for index in range(400)]
    assert np.std([f.lat_deg for f in fixes]) * 110_950.0 == pytest.approx(0.02, rel=0.15)
    assert np.std([f.lon_deg for f in fixes]) * 90_540.0 == pytest.approx(0.02, rel=0.15)
    assert np.std([f.alt_m for f in fixes]) == pytest.approx(0.02, rel=0.15)
    assert fix_at(0.0, 7) == fix_at(0.0, 7)
    assert fix_at(0.0, 7) != fix_at(0.0, 7, seed=2)


@pytest.mark.parametrize(("sigma_m", "quality"), [(0.01, "rtk_fixed"), (0.3, "rtk_float"), (2.0, "single")])
def test_quality_goes_with_sigma(sigma_m: float, quality: str) -> None:
    now = fix_at(0.0, sigma_m=sigma_m)
    assert (now.quality, now.sigma_m) == (quality, sigma_m)


def test_who_stands_has_no_course() -> None:
    assert fix_at(0.0, speed=0.0).course_rad is None
