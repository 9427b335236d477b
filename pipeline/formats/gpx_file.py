"""A GPX track as GNSS fixes: positions with times, from which speed and course are computed."""

from __future__ import annotations

from datetime import UTC, datetime
from math import radians
from xml.etree import ElementTree

from pyproj import Geod

from pipeline.common.time_range import is_time
from pipeline.formats.xml_text import parse_xml
from pipeline.types import GnssFix
from pipeline.types.source import SourceError

_SIGMA_M = 5.0
"""Accuracy of a phone or watch."""
_SLOWEST_MPS, _LONGEST_S = 1.0, 5.0
_EARTH = Geod(ellps="WGS84")


def parse_gpx(text: str, file: str) -> list[GnssFix]:
    """Every point of a GPX 1.0 or 1.1 track that has a time, in order. SourceError names the file if there is none."""
    root = parse_xml(text, file, SourceError)
    places: dict[int, tuple[float, float, float]] = {}
    for point in root.iterfind(".//{*}trkpt"):
        try:
            t_ns = _utc_ns(point.findtext("{*}time") or "")
            places[t_ns] = (float(point.get("lat", "")), float(point.get("lon", "")), _height(point))
        except ValueError:
            continue
    if len(places) < 2:
        raise SourceError(f"{file}: no track points with times")
    times = sorted(places)
    return [_fix(times, places, k) for k in range(len(times))]


def _fix(times: list[int], places: dict[int, tuple[float, float, float]], k: int) -> GnssFix:
    """A fix at a point, with speed and course from the previous point to the next one."""
    lat, lon, alt = places[times[k]]
    around = [each for each in times[max(k - 1, 0) : k + 2] if abs(each - times[k]) <= _LONGEST_S * 1e9]
    speed, course = 0.0, None
    if len(around) > 1:
        (lat0, lon0, _), (lat1, lon1, _) = places[around[0]], places[around[-1]]
        azimuth_deg, _, metres = _EARTH.inv(lon0, lat0, lon1, lat1)
        speed = metres / ((around[-1] - around[0]) / 1e9)
        course = radians(azimuth_deg) if speed >= _SLOWEST_MPS else None
    return GnssFix(times[k], lat, lon, alt, course, speed, "single", _SIGMA_M)


def _height(point: ElementTree.Element) -> float:
    return float(point.findtext("{*}ele") or 0.0)


def _utc_ns(text: str) -> int:
    """``2024-05-01T12:00:00.5Z`` as ns since 1970; without a zone it is UTC. ValueError where it is no time."""
    when = datetime.fromisoformat(text.strip())
    when = when if when.tzinfo is not None else when.replace(tzinfo=UTC)
    t_ns = round(when.timestamp() * 1e6) * 1000
    if not is_time(t_ns):
        raise ValueError
    return t_ns
