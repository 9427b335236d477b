"""A route prepared for driving: converted from WGS 84 to UTM once, resampled evenly, and smoothed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import atan2, cos, radians, sin

import numba
import numpy as np
from pyproj import Transformer

from pipeline.common.geometry import F64
from pipeline.types import Route

SPACING_M = 1.0
_SMALLEST_STEP_M = 0.3
_LONGEST_SMOOTHING_M = 8.0
_SMOOTHING_PER_SIGMA = 20.0
UTM_NORTH, UTM_SOUTH = 32600, 32700
"""EPSG codes of the UTM grids of WGS 84, without the zone that is added to them."""


@dataclass(frozen=True, eq=False)
class RouteLine:
    """A route as a line on a UTM grid."""

    route: Route
    """The original route, to detect changes."""
    epsg: int
    """EPSG code of the UTM zone of its first point."""
    places: F64
    """(K, 2) float64 east, north; one point per metre."""
    headings: F64
    """(K,) float64 radians counter-clockwise from grid east."""


def lay_out(route: Route) -> RouteLine | None:
    """The route as a line; None if all its points coincide. Points closer than 0.3 m are merged (a car that stood
    still). Recorded positions scatter, so they are smoothed over a length of 20 sigmas, 8 m at most; this shifts a bend
    of 125 m radius inwards by 0.26 m at worst, and not at all for RTK recordings."""
    lat, lon = np.asarray(route.lat_deg, np.float64), np.asarray(route.lon_deg, np.float64)
    good = np.isfinite(lat) & np.isfinite(lon)
    lat, lon = lat[good], lon[good]
    if len(lat) < 2:
        return None
    epsg = utm_zone(float(lat[0]), float(lon[0]))
    places = np.column_stack(_to_utm(epsg).transform(lon, lat))
    line = _evenly(places[np.isfinite(places).all(axis=1)])
    if line is None:
        return None
    length_m = min(_SMOOTHING_PER_SIGMA * route.sigma_m, _LONGEST_SMOOTHING_M)
    if length_m > SPACING_M:
        from scipy.ndimage import gaussian_filter1d  # takes 0.1 s to import, and planned routes are already smooth

        line = gaussian_filter1d(_extended(line, int(4 * length_m)), length_m, axis=0)[int(4 * length_m) :][: len(line)]
    headings = np.unwrap(np.arctan2(np.gradient(line[:, 1]), np.gradient(line[:, 0])))
    return RouteLine(route, epsg, line, headings)


def utm_zone(lat_deg: float, lon_deg: float) -> int:
    """EPSG code of the UTM zone of a WGS 84 position."""
    zone = min(int((lon_deg + 180.0) / 6.0) % 60 + 1, 60)
    return (UTM_NORTH if lat_deg >= 0.0 else UTM_SOUTH) + zone


def to_grid(epsg: int, lat_deg: float, lon_deg: float) -> tuple[float, float, float]:
    """East, north (metres) of a position, and the grid convergence there (radians): the angle of grid north clockwise
    from true north (Snyder, *Map Projections*, USGS PP 1395, eq. 8-9 without its small terms: accurate to 1e-5 within a
    zone)."""
    x, y = _to_utm(epsg).transform(lon_deg, lat_deg)
    middle_deg = 6.0 * ((epsg % 100) - 1) - 177.0
    off = radians((lon_deg - middle_deg + 180.0) % 360.0 - 180.0)
    return float(x), float(y), atan2(sin(off) * sin(radians(lat_deg)), cos(off))


@lru_cache(maxsize=8)
def _to_utm(epsg: int) -> Transformer:
    return Transformer.from_crs(4326, epsg, always_xy=True)


def _evenly(places: F64) -> F64 | None:
    """Points one metre apart on the line through the given points."""
    kept = places[_apart(places, _SMALLEST_STEP_M)] if len(places) else places
    if len(kept) < 2:
        return None
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(kept, axis=0).T))])
    at = np.arange(0.0, along[-1] + 1e-9, SPACING_M)
    if len(at) < 2:
        return None
    return np.column_stack([np.interp(at, along, kept[:, 0]), np.interp(at, along, kept[:, 1])])


def _extended(line: F64, count: int) -> F64:
    """The line with straight extensions, so that smoothing does not shorten it."""
    steps = np.arange(1, count + 1)[:, None]
    first, last = line[0] - line[min(5, len(line) - 1)], line[-1] - line[max(-6, -len(line))]
    first, last = first / max(np.hypot(*first), 1e-9), last / max(np.hypot(*last), 1e-9)
    return np.vstack([line[0] + steps[::-1] * first * SPACING_M, line, line[-1] + steps * last * SPACING_M])


@numba.njit(cache=True, nogil=True)
def _apart(places, smallest):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Which points lie at least ``smallest`` from the last one kept."""
    keep = np.zeros(len(places), np.bool_)
    keep[0] = True
    last = 0
    for k in range(1, len(places)):
        if np.hypot(places[k, 0] - places[last, 0], places[k, 1] - places[last, 1]) >= smallest:
            keep[k] = True
            last = k
    return keep
