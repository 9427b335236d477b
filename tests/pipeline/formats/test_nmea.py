"""NMEA sentences to fixes: real ones, damaged ones, and everything that the writer says."""

from __future__ import annotations

import math
from functools import reduce
from operator import xor

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.formats.nmea import NmeaReader
from pipeline.replay.nmea_writer import sentences
from pipeline.types import GnssFix, GnssQuality

NOON_NS = 1_700_049_600_000_000_000
"""2023-11-15 12:00:00 UTC."""
# From the NMEA standard's own example (RMC) and a receiver of the same moment.
GGA = "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"
RMC = "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A"
RMC_NS = 764_426_119_000_000_000
"""1994-03-23 12:35:19 UTC."""


def whole(body: str) -> str:
    """The sentence with its checksum."""
    return f"${body}*{reduce(xor, body.encode()):02X}"


def fixes(*lines: str, near_ns: int = NOON_NS) -> tuple[list[GnssFix], NmeaReader]:
    reader = NmeaReader()
    return [fix for line in lines if (fix := reader.push(line, near_ns)) is not None], reader


def test_two_sentences_of_a_moment_are_one_fix() -> None:
    (fix,), reader = fixes(GGA, RMC)
    assert fix.t_ns == RMC_NS
    assert (fix.lat_deg, fix.lon_deg) == pytest.approx((48.1173, 11.516667), abs=1e-6)
    assert fix.alt_m == pytest.approx(545.4 + 46.9), "above the ellipsoid"
    assert fix.speed_mps == pytest.approx(22.4 * 1852 / 3600)
    assert fix.course_rad == pytest.approx(math.radians(84.4))
    assert fix.quality == "single"
    assert fix.sigma_m == pytest.approx(3.0 * 0.9)
    assert reader.bad == 0


def test_a_receiver_with_rmc_alone_gives_fixes_without_height_from_the_second_moment_on() -> None:
    later = "$GPRMC,123520,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*60"
    third = "$GPRMC,123521,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*61"
    found, _ = fixes(RMC, later, third)
    assert [fix.t_ns - RMC_NS for fix in found] == [1_000_000_000, 2_000_000_000]
    assert math.isnan(found[0].alt_m)


def test_the_last_moment_is_given_at_the_end() -> None:
    reader = NmeaReader()
    assert reader.push(RMC, NOON_NS) is None
    fix = reader.flush(NOON_NS)
    assert fix is not None
    assert fix.t_ns == RMC_NS
    assert reader.flush(NOON_NS) is None


def test_a_sentence_lost_once_is_waited_for_again() -> None:
    moments = [said(fix_of(t_ns=NOON_NS + k * 100_000_000)) for k in range(4)]
    lines = [line for k, (gst, gga, rmc) in enumerate(moments) for line in (gst, rmc, *([] if k == 1 else [gga]))]
    found, _ = fixes(*lines)
    assert [(fix.t_ns - NOON_NS) // 100_000_000 for fix in found] == [0, 2, 3]
    assert not math.isnan(found[-1].alt_m)


@pytest.mark.parametrize(
    ("case", "lines", "bad"),
    [
        ("checksum wrong", (GGA[:-1] + "0", RMC[:-1] + "0"), 2),
        ("no checksum", (GGA.split("*")[0], RMC.split("*")[0]), 2),
        ("binary", ("\x00\ufffd\x10µb", "$" * 300), 2),
        ("void fix", (whole("GPRMC,123519,V,,,,,,,230394,,,N"),), 0),
        ("no satellites", (whole("GPGGA,123519,,,,,0,00,,,M,,M,,"),), 0),
        ("a sentence of another kind", (whole("GPGSV,1,1,00"),), 0),
    ],
)
def test_what_is_no_fix_gives_none(case: str, lines: tuple[str, ...], bad: int) -> None:
    found, reader = fixes(*lines)
    assert found == []
    assert reader.bad == bad


@pytest.mark.parametrize(
    "body",
    ["PUBX,00,123519.00,4807.038,N", "PMTK001,314,3", "PASHR,123519,84.4,T", "PQTMVER,1", "PGRME,15.0,M", "CCGPQ,GGA"],
)
def test_a_makers_own_sentence_or_a_query_among_the_others_changes_nothing(body: str) -> None:
    (fix,), reader = fixes(GGA, whole(body), RMC)
    assert fix.t_ns == RMC_NS
    assert reader.bad == 0


def test_a_number_without_end_is_no_fix() -> None:
    gst = whole("GPGST,123519,0.5,,,,inf,1.0,1.0")
    found, reader = fixes(gst, GGA, RMC)
    assert found == []
    assert reader.bad == 1


def test_garbage_between_costs_nothing() -> None:
    found, reader = fixes("��", GGA, "$GPGGA,half", RMC, "*")
    assert len(found) == 1
    assert reader.bad == 3


def test_a_standing_car_has_no_course() -> None:
    (fix,), _ = fixes(*said(fix_of(speed_mps=0.2, course_rad=1.0)))
    assert fix.course_rad is None


def fix_of(**changes: object) -> GnssFix:
    values: dict[str, object] = dict(
        t_ns=NOON_NS, lat_deg=35.65, lon_deg=128.4, alt_m=40.0, course_rad=1.0, speed_mps=20.0, quality="rtk_fixed",
        sigma_m=0.01,
    )  # fmt: skip
    return GnssFix(**{**values, **changes})  # type: ignore[arg-type]


def said(fix: GnssFix) -> list[str]:
    return sentences(fix, fix.t_ns).decode("ascii").splitlines()


@given(
    lat=st.floats(-89.9, 89.9),
    lon=st.floats(-179.9, 179.9),
    speed=st.floats(0.6, 80.0),
    course=st.floats(0.0, 6.28),
    centiseconds=st.integers(0, 86_400 * 100 * 400),
    quality=st.sampled_from(["single", "dgnss", "rtk_float", "rtk_fixed"]),
)
def test_what_the_writer_says_is_what_the_reader_hears(
    lat: float, lon: float, speed: float, course: float, centiseconds: int, quality: GnssQuality
) -> None:
    sent = fix_of(
        t_ns=NOON_NS + centiseconds * 10_000_000, lat_deg=lat, lon_deg=lon, speed_mps=speed, course_rad=course,
        quality=quality, sigma_m=0.123,
    )  # fmt: skip
    (heard,), reader = fixes(*said(sent), near_ns=sent.t_ns)
    assert reader.bad == 0
    assert heard.t_ns == sent.t_ns
    assert heard.lat_deg == pytest.approx(lat, abs=1e-8)
    assert heard.lon_deg == pytest.approx(lon, abs=1e-8)
    assert heard.speed_mps == pytest.approx(speed, abs=1e-4)
    assert heard.course_rad is not None
    assert math.remainder(heard.course_rad - course, 2 * math.pi) == pytest.approx(0.0, abs=1e-4)
    assert (heard.quality, heard.sigma_m) == (quality, 0.123)


@given(st.lists(st.one_of(st.text(max_size=90), st.sampled_from([GGA, RMC]).flatmap(
    lambda line: st.tuples(st.integers(0, len(line) - 1), st.characters()).map(
        lambda change: line[: change[0]] + change[1] + line[change[0] + 1 :])))))  # fmt: skip
def test_no_line_whatever_it_holds_raises(lines: list[str]) -> None:
    for fix in fixes(*lines)[0]:
        assert abs(fix.lat_deg) <= 90
        assert fix.speed_mps >= 0
