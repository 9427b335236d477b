"""Routes from files: CSV, GPX, a receiver's NMEA log, or an earlier session.

CSV: a column of latitudes and one of longitudes in degrees, found by their names, or the first two where there are
none. GPX 1.0 and 1.1: the points of the first track, else of the first route. NMEA 0183: GGA sentences, whose quality
says how good each place is, else RMC. A session: the fixes in it.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from statistics import median
from xml.etree import ElementTree

import numpy as np
import pynmea2

from pipeline.errors import BadInput
from pipeline.types import GnssFix, Route

_LAT_NAMES = ("lat", "lat_deg", "latitude", "latitude_deg")
_LON_NAMES = ("lon", "lon_deg", "lng", "long", "longitude", "longitude_deg")
SIGMA_BY_NMEA_QUALITY_M = {1: 2.0, 2: 0.8, 4: 0.02, 5: 0.3}
"""Of GGA's quality field: single, differential, RTK fixed, RTK float."""
_UNKNOWN_SIGMA_M = 0.5
"""Of a file that does not say how good it is: a drawn or surveyed route."""
_LARGEST_FILE_BYTES = 200_000_000

Rows = list[tuple[float, float]]


class RouteError(BadInput):
    """A route that cannot be used; the text names the file and what is wrong with it."""


def load_route(path: str) -> Route:
    """The route in a file. RouteError says in one sentence what is wrong."""
    file = Path(path).expanduser()
    try:
        if file.suffix.lower() == ".mcap":
            return _from_session(path, file.stem)
        if file.stat().st_size > _LARGEST_FILE_BYTES:
            raise RouteError(f"{path}: too large for a route")
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise RouteError(f"{path}: {error.strerror}") from None
    rows, sigma_m = _reader(file.suffix.lower(), text)(text, path)
    return _route(file.stem, rows, sigma_m, path)


def from_fixes(name: str, fixes: Iterable[GnssFix]) -> Route:
    """The route of an earlier drive, as good as its median fix. RouteError when it goes nowhere."""
    known = list(fixes)
    sigma_m = median(fix.sigma_m for fix in known) if known else 0.0
    return _route(name, [(fix.lat_deg, fix.lon_deg) for fix in known], sigma_m, name)


def _route(name: str, rows: Rows, sigma_m: float, path: str) -> Route:
    good = [(lat, lon) for lat, lon in rows if abs(lat) <= 84.0 and abs(lon) <= 180.0 and (lat, lon) != (0.0, 0.0)]
    if len(set(good)) < 2:
        raise RouteError(f"{path}: no route in it: {len(set(good))} places on the Earth, at least 2 are needed")
    lat, lon = np.array(good).T
    return Route(name, lat.copy(), lon.copy(), sigma_m)


def _reader(suffix: str, text: str) -> Callable[[str, str], tuple[Rows, float]]:
    """By the file's name, else by how it begins."""
    start = text.lstrip("\ufeff \r\n\t")[:200]
    if suffix == ".gpx" or start.startswith("<"):
        return _gpx
    return _nmea if suffix == ".nmea" or start.startswith(("$", "!")) else _csv


def _csv(text: str, path: str) -> tuple[Rows, float]:
    sample = text[:4096]
    delimiter = max(",;\t ", key=sample.count)
    try:
        lines = [row for row in csv.reader(io.StringIO(text.lstrip("\ufeff")), delimiter=delimiter) if row]
    except csv.Error as error:
        raise RouteError(f"{path}: not CSV: {error}") from None
    if not lines:
        return [], _UNKNOWN_SIGMA_M
    names = [cell.strip().lower() for cell in lines[0]]
    lat = next((names.index(name) for name in _LAT_NAMES if name in names), None)
    lon = next((names.index(name) for name in _LON_NAMES if name in names), None)
    if lat is None or lon is None:
        if _number(lines[0][0]) is None:
            raise RouteError(f"{path}: no columns named lat and lon; it has {', '.join(names[:8])}")
        lat, lon = 0, 1
    else:
        lines = lines[1:]
    pairs = [(_number(row[lat]), _number(row[lon])) for row in lines if len(row) > max(lat, lon)]
    return [(a, b) for a, b in pairs if a is not None and b is not None], _UNKNOWN_SIGMA_M


def _gpx(text: str, path: str) -> tuple[Rows, float]:
    if "<!DOCTYPE" in text[:10_000] or "<!ENTITY" in text:
        raise RouteError(f"{path}: GPX needs no document type or entities, and none are read")
    try:
        root = ElementTree.fromstring(text.lstrip("\ufeff \r\n\t").encode())
    except ElementTree.ParseError as error:
        raise RouteError(f"{path}: not XML: {error}") from None
    for kind, point in (("trk", "trkpt"), ("rte", "rtept")):
        line = root.find(f"{{*}}{kind}")
        if line is not None:
            found = [(_number(each.get("lat")), _number(each.get("lon"))) for each in line.iter() if _is(each, point)]
            return [(a, b) for a, b in found if a is not None and b is not None], _UNKNOWN_SIGMA_M
    return [], _UNKNOWN_SIGMA_M


def _nmea(text: str, path: str) -> tuple[Rows, float]:
    places: dict[str, Rows] = {"GGA": [], "RMC": []}
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
    """Kind, latitude and longitude in degrees, and sigma in metres; null for a sentence of another kind, without a fix,
    with a wrong checksum, or with something else where its numbers should be."""
    try:
        sentence = pynmea2.parse(line[line.index("$") :].strip(), check=True)
        kind = getattr(sentence, "sentence_type", "")
        if kind not in ("GGA", "RMC") or not sentence.lat:
            return None
        quality = int(sentence.gps_qual or 0) if kind == "GGA" else int(sentence.status == "A")
        place = float(sentence.latitude), float(sentence.longitude)
    except (pynmea2.ParseError, ValueError, TypeError, IndexError, AttributeError):
        return None
    return (kind, place, SIGMA_BY_NMEA_QUALITY_M.get(quality, SIGMA_BY_NMEA_QUALITY_M[1])) if quality else None


def _from_session(path: str, name: str) -> Route:
    from pipeline.recording.session import SessionSource  # half a second of imports: only who opens one pays

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
