"""A simulated RTK receiver: where the ego origin is on the Earth, with noise.

The world's x, y plane is placed at the scenario's origin with x in a chosen compass direction, and converted via
Earth-centred coordinates to latitude and longitude on the WGS 84 ellipsoid (NIMA TR8350.2; the inverse after Bowring
1985, exact to well under a millimetre this close to the ground).
"""

from __future__ import annotations

import numpy as np

from pipeline.simulation.sensors.gnss_model import GnssModel
from pipeline.simulation.world.world_state import World
from pipeline.types import F64, GnssFix

_A_M, _F = 6_378_137.0, 1.0 / 298.257223563
_E2 = _F * (2.0 - _F)
_B_M = _A_M * (1.0 - _F)
_SLOWEST_COURSE_MPS = 0.5


def fix(world: World, model: GnssModel, seed: int, index: int, t_ns: int) -> GnssFix:
    """The receiver's fix at one moment. The same seed and index give the same noise."""
    noise = np.random.default_rng([seed, 8, index]).standard_normal(5)
    x, y, heading = world.pose
    turn = np.radians(90.0 - model.x_axis_deg)  # of the x axis, counter-clockwise from east
    c, s = np.cos(turn), np.sin(turn)
    east = x * c - y * s + model.sigma_m * noise[0]
    north = x * s + y * c + model.sigma_m * noise[1]
    lat_deg, lon_deg, _ = from_local(np.array([east, north, 0.0]), model.lat_deg, model.lon_deg, model.alt_m)
    course = np.pi / 2 - (heading + turn) + np.radians(model.sigma_course_deg) * noise[3]
    return GnssFix(
        t_ns,
        lat_deg,
        lon_deg,
        alt_m=model.alt_m + model.sigma_up_m * float(noise[2]),
        course_rad=float(course % (2 * np.pi)) if world.speed_mps >= _SLOWEST_COURSE_MPS else None,
        speed_mps=max(0.0, world.speed_mps + model.sigma_speed_mps * float(noise[4])),
        quality="rtk_fixed" if model.sigma_m <= 0.05 else "rtk_float" if model.sigma_m <= 0.5 else "single",
        sigma_m=model.sigma_m,
    )


def from_local(place: F64, lat_deg: float, lon_deg: float, alt_m: float) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and height of a position given as metres east, north and up of an origin."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    north = np.array([-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    x, y, z = to_earth(lat_deg, lon_deg, alt_m) + np.column_stack([east, north, up]) @ place
    reach = float(np.hypot(x, y))
    reduced = np.arctan2(z * _A_M, reach * _B_M)
    lat = np.arctan2(
        z + _E2 * _A_M**2 / _B_M * np.sin(reduced) ** 3,
        reach - _E2 * _A_M * np.cos(reduced) ** 3,
    )
    height = reach * np.cos(lat) + z * np.sin(lat) - _A_M * np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    return float(np.degrees(lat)), float(np.degrees(np.arctan2(y, x))), float(height)


def to_earth(lat_deg: float, lon_deg: float, alt_m: float) -> F64:
    """(3,) Earth-centred, Earth-fixed metres of a position on WGS 84."""
    lat, lon = np.radians(lat_deg), np.radians(lon_deg)
    normal = _A_M / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    flat = (normal + alt_m) * np.cos(lat)
    return np.array([flat * np.cos(lon), flat * np.sin(lon), (normal * (1.0 - _E2) + alt_m) * np.sin(lat)])
