"""Reads routes from files: CSV, GPX, a receiver's NMEA log, or an earlier session.

CSV: one column of latitudes and one of longitudes in degrees, found by their names, or the first two if there are no
names; or easting and northing in metres of one UTM zone, given in a third column (``zone`` 32N, ``epsg`` 32632) or with
the file name: ``route.csv?epsg=32632``. GPX 1.0 and 1.1: the points of the first track, else of the first route. NMEA
0183: GGA sentences, whose quality says how good each position is, else RMC. A session: the fixes in it.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable
from statistics import median
from xml.etree import ElementTree

import numpy as np
from pyproj import Geod, Transformer

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import given_path
from pipeline.common.files.user_files import read_regular
from pipeline.formats.nmea import parse_sentence
from pipeline.formats.xml_text import parse_xml
from pipeline.path.route_line import UTM_NORTH, UTM_SOUTH
from pipeline.types import GnssFix, Route

_LAT_NAMES = ("lat", "lat_deg", "latitude", "latitude_deg")
_LON_NAMES = ("lon", "lon_deg", "lng", "long", "longitude", "longitude_deg")
_EAST_NAMES = ("easting", "easting_m", "east", "utm_easting", "utm_x")
_NORTH_NAMES = ("northing", "northing_m", "north", "utm_northing", "utm_y")
_ZONE_NAMES = ("epsg", "zone", "utm_zone")
SIGMA_BY_NMEA_QUALITY_M = {1: 2.0, 2: 0.8, 4: 0.02, 5: 0.3}
"""By GGA's quality field: single, differential, RTK fixed, RTK float."""
_UNKNOWN_SIGMA_M = 0.5
"""For a file without accuracy: a drawn or surveyed route."""
_LARGEST_FILE_BYTES = 200_000_000
_LONGEST_GAP_M = 250e3
"""Between neighbouring positions. The longest straight road, on Saudi Arabia's Highway 10, has 240 km; a file of other
numbers, read as degrees, jumps farther."""
_LONGEST_M = 5e6
"""Of a whole route: two days of driving. It is resampled at every metre, which takes 16 bytes each."""

PositionRows = list[tuple[float, float]]


class RouteError(BadInput):
    """A route that cannot be used; the text names the file and what is wrong with it."""


def load_route(path: str) -> Route:
    """The route in a file; append ``?epsg=32632`` to its name if its positions are in a UTM zone that it does not name.
    RouteError says in one sentence what is wrong."""
    path, _, zone = path.partition("?epsg=")
    file = given_path(path, RouteError)
    try:
        if file.suffix.lower() == ".mcap":
            return _from_session(path, file.stem)
        text = read_regular(file, _LARGEST_FILE_BYTES).decode("utf-8", "replace")
    except OSError as error:
        raise RouteError(f"{path}: {error.strerror}") from None
    reader = _reader(file.suffix.lower(), text)
    if zone and reader is not _csv:
        raise RouteError(f"{path}: UTM coordinates are read from CSV only")
    rows, sigma_m = _csv(text, path, zone) if reader is _csv else reader(text, path)
    return _route(file.stem, rows, sigma_m, path)


def from_fixes(name: str, fixes: Iterable[GnssFix]) -> Route:
    """The route of an earlier drive, with the accuracy of its median fix. RouteError if it does not move."""
    known = list(fixes)
    sigma_m = median(fix.sigma_m for fix in known) if known else 0.0
    return _route(name, [(fix.lat_deg, fix.lon_deg) for fix in known], sigma_m, name)


def _route(name: str, rows: PositionRows, sigma_m: float, path: str) -> Route:
    good = [(lat, lon) for lat, lon in rows if abs(lat) <= 84.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0)]
    if len(set(good)) < 2:
        raise RouteError(f"{path}: no route: {len(set(good))} distinct valid positions; at least 2 are needed")
    lat, lon = np.array(good).T
    # lists, since pyproj before 3.8 takes an array of one element for a number, which numpy deprecates
    ends = [each.tolist() for each in (lon[:-1], lat[:-1], lon[1:], lat[1:])]
    apart_m = np.array(Geod(ellps="WGS84").inv(*ends)[2])
    if apart_m.max() > _LONGEST_GAP_M or apart_m.sum() > _LONGEST_M:
        raise RouteError(
            f"{path}: no route: it is {apart_m.sum() / 1e3:,.0f} km long, with {apart_m.max() / 1e3:,.0f} km between "
            f"two positions; at most {_LONGEST_M / 1e3:,.0f} and {_LONGEST_GAP_M / 1e3:,.0f} km are possible: are "
            "these latitudes and longitudes in degrees?"
        )
    return Route(name, lat.copy(), lon.copy(), sigma_m)


def _reader(suffix: str, text: str) -> Callable[[str, str], tuple[PositionRows, float]]:
    """By the file's name, else by its first characters."""
    start = text.lstrip("\ufeff \r\n\t")[:200]
    if suffix == ".gpx" or start.startswith("<"):
        return _gpx
    return _nmea if suffix == ".nmea" or start.startswith(("$", "!")) else _csv


def _csv(text: str, path: str, zone: str = "") -> tuple[PositionRows, float]:
    sample = text[:4096]
    delimiter = max(",;\t ", key=sample.count)
    try:
        lines = [row for row in csv.reader(io.StringIO(text.lstrip("\ufeff")), delimiter=delimiter) if row]
    except csv.Error as error:
        raise RouteError(f"{path}: not CSV: {error}") from None
    if not lines:
        return [], _UNKNOWN_SIGMA_M
    names = [cell.strip().lower() for cell in lines[0]]
    east, north = _column(names, _EAST_NAMES), _column(names, _NORTH_NAMES)
    if east is not None and north is not None:
        return _from_utm(lines[1:], east, north, _column(names, _ZONE_NAMES), zone, path), _UNKNOWN_SIGMA_M
    if zone:
        raise RouteError(f"{path}: no columns named easting and northing; it has {', '.join(names[:8])}")
    lat, lon = _column(names, _LAT_NAMES), _column(names, _LON_NAMES)
    if lat is None or lon is None:
        if _number(lines[0][0]) is None:
            raise RouteError(
                f"{path}: no columns named lat and lon, or easting and northing; it has {', '.join(names[:8])}"
            )
        lat, lon = 0, 1
    else:
        lines = lines[1:]
    pairs = [(_number(row[lat]), _number(row[lon])) for row in lines if len(row) > max(lat, lon)]
    return [(a, b) for a, b in pairs if a is not None and b is not None], _UNKNOWN_SIGMA_M


def _column(names: list[str], known: tuple[str, ...]) -> int | None:
    return next((names.index(name) for name in known if name in names), None)


def _from_utm(lines: list[list[str]], east: int, north: int, zone_at: int | None, zone: str, path: str) -> PositionRows:
    """Latitudes and longitudes of positions in metres of one UTM zone: the requested one, else the file's own."""
    rows = [row for row in lines if len(row) > max(east, north)]
    named = {row[zone_at].strip() for row in rows if len(row) > zone_at} if zone_at is not None and not zone else {zone}
    epsg = {utm_epsg(each) for each in named}
    if len(epsg) != 1 or None in epsg:
        wrong = f"not one UTM zone: {', '.join(sorted(named))[:80]}" if named - {""} else "no UTM zone given"
        raise RouteError(f"{path}: {wrong}; add a column zone (32N) or epsg (32632), or open {path}?epsg=32632")
    pairs = [(_number(row[east]), _number(row[north])) for row in rows]
    places = [(x, y) for x, y in pairs if x is not None and y is not None]
    to_degrees = Transformer.from_crs(epsg.pop(), 4326, always_xy=True)
    degrees = [to_degrees.transform(x, y) for x, y in places]
    return [(lat, lon) for lon, lat in degrees if math.isfinite(lat) and math.isfinite(lon)]


def utm_epsg(zone: str) -> int | None:
    """EPSG code of a UTM zone on WGS 84 given as code (32632, EPSG:32632) or as number and hemisphere (32N); None for
    anything else. Letters of latitude bands are not accepted: band S is in the north."""
    match = re.fullmatch(r"(?:EPSG:)?(32[67])(\d\d)|(\d{1,2}) ?([NS])", zone.strip().upper())
    if match is None:
        return None
    base = int(match[1]) * 100 if match[1] else UTM_NORTH if match[4] == "N" else UTM_SOUTH
    number = int(match[2] or match[3])
    return base + number if 1 <= number <= 60 else None


def _gpx(text: str, path: str) -> tuple[PositionRows, float]:
    root = parse_xml(text, path, RouteError)
    for kind, point in (("trk", "trkpt"), ("rte", "rtept")):
        line = root.find(f"{{*}}{kind}")
        if line is not None:
            found = [(_number(each.get("lat")), _number(each.get("lon"))) for each in line.iter() if _is(each, point)]
            return [(a, b) for a, b in found if a is not None and b is not None], _UNKNOWN_SIGMA_M
    return [], _UNKNOWN_SIGMA_M


def _nmea(text: str, path: str) -> tuple[PositionRows, float]:
    places: dict[str, PositionRows] = {"GGA": [], "RMC": []}
    sigmas: dict[str, list[float]] = {"GGA": [], "RMC": []}
    for line in text.splitlines():
        found = _nmea_place(line)
        if found is not None:
            kind, place, sigma_m = found
            places[kind].append(place)
            sigmas[kind].append(sigma_m)
    kind = "GGA" if places["GGA"] else "RMC"
    return places[kind], median(sigmas[kind] or [_UNKNOWN_SIGMA_M])


def _nmea_place(line: str) -> tuple[str, tuple[float, float], float] | None:
    """Kind, latitude and longitude in degrees, and sigma in metres; None for a sentence of another kind, without a fix,
    with a wrong checksum, or with invalid numbers."""
    try:
        sentence = parse_sentence(line[line.index("$") :])
        kind = sentence.sentence_type if sentence is not None else ""
        if sentence is None or kind not in ("GGA", "RMC") or not sentence.lat:
            return None
        quality = int(sentence.gps_qual or 0) if kind == "GGA" else int(sentence.status == "A")
        place = float(sentence.latitude), float(sentence.longitude)
    except (ValueError, TypeError, AttributeError):
        return None
    return (kind, place, SIGMA_BY_NMEA_QUALITY_M.get(quality, SIGMA_BY_NMEA_QUALITY_M[1])) if quality else None


def _from_session(path: str, name: str) -> Route:
    # takes half a second to import, only needed for sessions
    from pipeline.recording.session.source import SessionSource

    session = SessionSource(f"mcap:{path}", path)
    try:
        return from_fixes(name, session.fixes())
    finally:
        session.close()


def _is(element: ElementTree.Element, name: str) -> bool:
    return element.tag.rpartition("}")[2] == name


def _number(text: str | None) -> float | None:
    try:
        value = float(text) if text is not None else math.nan
    except ValueError:
        return None
    return value if math.isfinite(value) else None
