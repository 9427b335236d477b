"""Routes from what people have: spreadsheets, hikers' files, receivers' logs, earlier drives."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from pipeline.recording.session.writer import SessionWriter
from pipeline.sources import open_source
from pipeline.sources.along_route import along_route
from pipeline.sources.route_files import RouteError, from_fixes, load_route
from pipeline.types import GnssFix, Route
from tests.pipeline.recording.frames import ABOUT, full

GPX = '<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/{}" version="1.{}">{}</gpx>'
POINTS = '<{0} lat="48.1" lon="11.2"/><{0} lat="48.2" lon="11.3"><ele>500</ele></{0}>'
GGA = (
    "$GPGGA,123519,4807.038,N,01131.000,E,4,08,0.9,545.4,M,46.9,M,,*42\n"
    "$GPGGA,123520,4807.138,N,01131.000,E,4,08,0.9,545.4,M,46.9,M,,*49\n"
)
RMC = (
    "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\n"
    "$GPRMC,123520,A,4807.138,N,01131.000,E,022.4,084.4,230394,003.1,W*61\n"
)


def gga(latitude: str, quality: str) -> str:
    """A sentence with these fields and a valid checksum."""
    body = f"GPGGA,123521,{latitude},N,01131.000,E,{quality},08,0.9,545.4,M,46.9,M,,"
    return f"${body}*{reduce(xor, body.encode()):02X}\n"


def written(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


@pytest.mark.parametrize(
    ("text", "asked"),
    [
        pytest.param("easting,northing\n{0},{1}\n{2},{3}\n", "?epsg=32632", id="asked for by EPSG code"),
        pytest.param("easting,northing\n{0},{1}\n{2},{3}\n", "?epsg=32N", id="asked for by zone"),
        pytest.param("t,Northing,Easting,zone\n0,{1},{0},32N\n1,{3},{2},32N\n", "", id="a column of zones"),
        pytest.param("easting;northing;epsg\n{0};{1};32632\nx;y;32632\n{2};{3};32632\n", "", id="a column of codes"),
    ],
)
def test_places_of_a_utm_zone(tmp_path: Path, text: str, asked: str) -> None:
    """The same positions as in degrees, to a millimetre."""
    utm = Transformer.from_crs(4326, 32632, always_xy=True)
    places = [*utm.transform(11.2, 48.1), *utm.transform(11.3, 48.2)]
    route = load_route(written(tmp_path, "a.csv", text.format(*places)) + asked)
    assert route.name == "a"
    assert route.lat_deg == pytest.approx([48.1, 48.2], abs=1e-8)
    assert route.lon_deg == pytest.approx([11.2, 11.3], abs=1e-8)


@pytest.mark.parametrize(
    ("text", "asked", "says"),
    [
        pytest.param("easting,northing\n1,2\n3,4\n", "", "no UTM zone given", id="no zone"),
        pytest.param("easting,northing\n1,2\n3,4\n", "?epsg=4326", "not one UTM zone: 4326", id="no UTM"),
        pytest.param("easting,northing\n1,2\n3,4\n", "?epsg=61N", "not one UTM zone: 61N", id="no such zone"),
        pytest.param("east,north,zone\n1,2,32N\n3,4,33N\n", "", "not one UTM zone: 32N, 33N", id="two zones"),
        pytest.param("lat,lon\n48,11\n48.1,11\n", "?epsg=32632", "no columns named easting and", id="degrees"),
        pytest.param(GGA, "?epsg=32632", "UTM coordinates are read from CSV only", id="another kind of file"),
    ],
)
def test_a_utm_zone_that_is_missing_or_wrong_is_said(tmp_path: Path, text: str, asked: str, says: str) -> None:
    with pytest.raises(RouteError, match=says):
        load_route(written(tmp_path, "a.csv", text) + asked)


@pytest.mark.parametrize(
    ("name", "text", "sigma_m"),
    [
        pytest.param("a.csv", "lat,lon\n48.1,11.2\n48.2,11.3\n", 0.5, id="CSV"),
        pytest.param("a.csv", "t;Longitude;Latitude\n0;11.2;48.1\n1;11.3;48.2\n", 0.5, id="CSV by name, semicolons"),
        pytest.param("a.txt", "48.1 11.2\n48.2 11.3\n", 0.5, id="two columns"),
        pytest.param("a.csv", "\ufefflat,lon\n48.1,11.2\nnan,11\nx,y\n48.2,11.3\n", 0.5, id="CSV with rubbish in it"),
        pytest.param("a.gpx", GPX.format(1, 1, f"<trk><trkseg>{POINTS.format('trkpt')}</trkseg></trk>"), 0.5, id="GPX"),
        pytest.param(
            "a.gpx",
            GPX.replace('"1.0"?', '"1.0" encoding="utf-7"?').format(1, 1, f"<rte>{POINTS.format('rtept')}</rte>"),
            0.5,
            id="GPX in an encoding that expat has not",
        ),
        pytest.param("a.gpx", GPX.format(0, 0, f"<rte>{POINTS.format('rtept')}</rte>"), 0.5, id="GPX 1.0 route"),
    ],
)
def test_places(tmp_path: Path, name: str, text: str, sigma_m: float) -> None:
    route = load_route(written(tmp_path, name, text))
    assert route.lat_deg.tolist() == [48.1, 48.2]
    assert route.lon_deg.tolist() == [11.2, 11.3]
    assert (route.name, route.sigma_m) == ("a", sigma_m)


@pytest.mark.parametrize(
    ("text", "sigma_m"),
    [
        (GGA, 0.02),
        (RMC, 2.0),
        (GGA + RMC + "$GPZDA,1*00\nrubbish\n", 0.02),
        (GGA + gga("4807.038", "x") + gga("abc", "4") + gga("4807.038", "0"), 0.02),
    ],
)
def test_nmea_logs_say_how_good_they_are(tmp_path: Path, text: str, sigma_m: float) -> None:
    route = load_route(written(tmp_path, "log.nmea", text))
    assert route.lat_deg == pytest.approx([48.1173, 48.1189667], abs=1e-6)
    assert route.lon_deg == pytest.approx([11.5166667] * 2, abs=1e-6)
    assert route.sigma_m == sigma_m


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        pytest.param("a.csv", "", "no route:", id="empty"),
        pytest.param("a.csv", "a,b\n1,2\n", "no columns named lat and lon", id="other columns"),
        pytest.param("a.csv", "lat,lon\n48,11\n48,11\n", "1 distinct valid positions", id="one place"),
        pytest.param("a.csv", "lat,lon\n480,11\n481,11\n", "0 distinct valid positions", id="not on the Earth"),
        pytest.param("a.csv", 'lat,lon\n"48,11\n' + "48.1,11.2\n" * 20_000, "not CSV: field larger", id="open quote"),
        pytest.param("a.gpx", "<gpx", "not XML", id="cut off"),
        pytest.param("a.gpx", '<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "document type", id="entities"),
        pytest.param("a.nmea", GGA.replace("E,4,", "E,0,"), "no route:", id="no fix, wrong checksums"),
    ],
)
def test_what_is_no_route_is_told_in_one_sentence(tmp_path: Path, name: str, text: str, says: str) -> None:
    path = written(tmp_path, name, text)
    with pytest.raises(RouteError, match=says) as told:
        load_route(path)
    assert str(told.value).startswith(path)


def test_a_missing_file_and_a_folder(tmp_path: Path) -> None:
    for path in (tmp_path / "none.csv", tmp_path):
        with pytest.raises(RouteError, match=str(path)):
            load_route(str(path))


def test_an_earlier_drive() -> None:
    fixes = [GnssFix(k, 48.0 + k * 1e-4, 11.0, 0.0, None, 1.0, "rtk_fixed", 0.01) for k in range(3)]
    route = from_fixes("drive", fixes)
    assert route.lat_deg.tolist() == [fix.lat_deg for fix in fixes]
    assert route.sigma_m == 0.01
    with pytest.raises(RouteError, match="no route:"):
        from_fixes("nothing", [])


def test_of_an_earlier_session_the_fixes_alone_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = SessionWriter(tmp_path / "earlier.mcap", ABOUT)
    frames = [full(index) for index in range(3)]
    for frame in frames:
        fix = frame.gnss
        assert fix is not None
        writer.write(replace(frame, gnss=replace(fix, lat_deg=fix.lat_deg + 1e-4 * frame.index)))
    writer.write(replace(full(3), gnss=None))
    writer.close()
    for decoder in ("sweep_from", "image_from"):
        monkeypatch.setattr(f"pipeline.recording.session.source.{decoder}", lambda *of: pytest.fail("decoded"))
    route = load_route(str(tmp_path / "earlier.mcap"))
    first = frames[0].gnss
    assert first is not None
    assert route.lat_deg == pytest.approx([first.lat_deg + 1e-4 * index for index in range(3)])
    assert (route.name, route.sigma_m) == ("earlier", first.sigma_m)


def test_a_source_along_a_route() -> None:
    source = open_source("sim:straight")
    route = Route("mine", np.array([1.0, 2.0]), np.array([3.0, 4.0]), 0.1)
    along = along_route(source, route)
    assert along_route(source, None) is source
    assert (along.uri, along.title, len(along)) == (source.uri, source.title, len(source))
    assert along.frame(3).route is route
    assert along.t_ns(3) == source.t_ns(3)
    own = source.frame(3).route
    assert own is not None
    assert own.name.startswith("planned")


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("0 2 356.4 195.8\n0 40 545.9 182.2\n1 3 374.1 216.6\n", id="another file's numbers"),
        pytest.param("lat,lon\n48.1,11.2\n0.01,0.01\n48.2,11.3\n", id="a jump"),
        pytest.param("lat,lon\n" + "48.0,11.0\n49.0,11.0\n" * 30, id="6,600 km"),
    ],
)
def test_a_route_that_nobody_can_drive_is_refused(tmp_path: Path, text: str) -> None:
    """Resampled at every metre, it would fill the memory before the first frame."""
    with pytest.raises(RouteError, match=r"no route: it is [\d,]+ km long, with [\d,]+ km between two positions"):
        load_route(written(tmp_path, "a.txt", text))
