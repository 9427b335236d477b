"""NMEA 0183 sentences of a GNSS receiver → fixes. GGA gives position and quality, RMC time, speed and course, GST the
accuracy (IEC 61162-1)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import UTC, date, datetime, time, timedelta
from typing import Any

import pynmea2

from pipeline.types import GnssFix, GnssQuality
from pipeline.types.frame import SLOWEST_COURSE_MPS

KNOT_MPS = 1852.0 / 3600.0
_QUALITY: Mapping[int, GnssQuality] = {1: "single", 2: "dgnss", 3: "single", 4: "rtk_fixed", 5: "rtk_float"}
"""GGA's quality indicator; 0 is no fix, 6 to 8 are dead reckoning, typed in or simulated."""
_RANGE_ERROR_M: Mapping[GnssQuality, float] = {"single": 3.0, "dgnss": 1.0, "rtk_float": 0.3, "rtk_fixed": 0.015}
"""Typical range error; multiplied by the dilution of precision it gives the position error if there is no GST
sentence."""
_BEARING = frozenset({"GGA", "RMC"})
"""Sentences required for a fix."""
_LONGEST_SENTENCE = 256


class BadSentence(ValueError):
    """A line that is not a complete sentence; the text is the reason."""


class NmeaReader:
    """Combines the sentences of one moment. bad: number of invalid lines. no_fix: number of moments without a
    position."""

    def __init__(self) -> None:
        self.bad = self.no_fix = 0
        self._moment: time | None = None
        self._said: dict[str, Any] = {}
        self._is_given = False
        self._expected = set(_BEARING)
        self._date: date | None = None

    def push(self, line: str, near_ns: int) -> GnssFix | None:
        """Take one line; returns the fix of a moment once all its sentences have arrived. Never raises.

        near_ns: approximate current time, unix; gives the date until an RMC does. The fix's ``t_ns`` is the receiver's
        own UTC; its height is NaN if the receiver sends no GGA.
        """
        try:
            sentence = parse_sentence(line)
        except BadSentence:
            self.bad += 1
            return None
        if sentence is None:
            return None
        kind, moment = sentence.sentence_type, getattr(sentence, "timestamp", None)
        if kind not in ("GGA", "RMC", "GST") or not isinstance(moment, time):
            return None
        if moment != self._moment:
            self._begin(moment)
        self._said[kind] = sentence
        if self._is_given:
            self._expected |= {kind} & _BEARING
            return None
        return self._give(near_ns) if self._expected <= self._said.keys() else None

    def flush(self, near_ns: int) -> GnssFix | None:
        """At the end of the sentences: the fix of the last moment, if it was not returned yet."""
        return self._give(near_ns) if self._said and not self._is_given else None

    def _begin(self, moment: time) -> None:
        """Start a new moment. Sentences missing in the last one are no longer waited for, until they arrive again."""
        if self._said and not self._is_given:
            self._expected = self._said.keys() & _BEARING or set(_BEARING)
        self._moment, self._said, self._is_given = moment, {}, False

    def _give(self, near_ns: int) -> GnssFix | None:
        self._is_given = True
        return self._fix(near_ns)

    def _fix(self, near_ns: int) -> GnssFix | None:
        gga, rmc, gst = (self._said.get(kind) for kind in ("GGA", "RMC", "GST"))
        try:
            fix = self._fix_of(gga, rmc, gst, near_ns)
        except (ValueError, TypeError, AttributeError, OverflowError):
            self.bad += 1
            return None
        self.no_fix += fix is None
        return fix

    def _fix_of(self, gga: Any, rmc: Any, gst: Any, near_ns: int) -> GnssFix | None:
        quality = _quality(gga, rmc)
        place = gga if gga is not None else rmc
        if quality is None or place is None or not place.lat or not place.lon:
            return None
        if rmc is not None and isinstance(rmc.datestamp, date):
            self._date = rmc.datestamp
        speed_mps = float(rmc.spd_over_grnd) * KNOT_MPS if rmc is not None and rmc.spd_over_grnd is not None else None
        if speed_mps is None or self._moment is None:
            return None
        course = rmc.true_course
        is_moving = course is not None and speed_mps >= SLOWEST_COURSE_MPS
        lat_deg, lon_deg = float(place.latitude), float(place.longitude)
        if not (abs(lat_deg) <= 90.0 and abs(lon_deg) <= 180.0):
            raise ValueError("an impossible position")
        course_rad, sigma_m = math.radians(float(course)) if is_moving else None, _sigma_m(gga, gst, quality)
        if not all(map(math.isfinite, (speed_mps, course_rad or 0.0, sigma_m))):
            raise ValueError("a number that is not finite")
        return GnssFix(
            _unix_ns(self._date, self._moment, near_ns),
            lat_deg,
            lon_deg,
            alt_m=_height_m(gga),
            course_rad=course_rad,
            speed_mps=speed_mps,
            quality=quality,
            sigma_m=sigma_m,
        )


def parse_sentence(line: str) -> pynmea2.TalkerSentence | None:
    """A standard sentence; None for a proprietary one (``$P…``) and for a query, which receivers send as well.
    BadSentence if the line is damaged or has no checksum: garbage often looks like text."""
    if len(line) > _LONGEST_SENTENCE or "*" not in line:
        raise BadSentence("not a complete sentence")
    try:
        sentence = pynmea2.parse(line.strip(), check=True)
    except Exception as error:  # its parsers for each maker's sentences raise what they happen to stumble over
        raise BadSentence(str(error)) from None
    return sentence if isinstance(sentence, pynmea2.TalkerSentence) else None


def _quality(gga: Any, rmc: Any) -> GnssQuality | None:
    if gga is not None:
        return _QUALITY.get(int(gga.gps_qual)) if gga.gps_qual is not None else None
    return "single" if rmc is not None and rmc.status == "A" else None


def _height_m(gga: Any) -> float:
    """Height above the ellipsoid: height above the geoid plus the geoid separation."""
    if gga is None or gga.altitude is None:
        return math.nan
    return float(gga.altitude) + float(gga.geo_sep or 0.0)


def _sigma_m(gga: Any, gst: Any, quality: GnssQuality) -> float:
    if gst is not None and gst.std_dev_latitude is not None and gst.std_dev_longitude is not None:
        return max(float(gst.std_dev_latitude), float(gst.std_dev_longitude))
    dilution = float(gga.horizontal_dil) if gga is not None and gga.horizontal_dil else 1.0
    return _RANGE_ERROR_M[quality] * max(dilution, 0.5)


def _unix_ns(day: date | None, moment: time, near_ns: int) -> int:
    """The time on ``day``; without a day, on the day that brings it closest to ``near_ns``."""
    near = datetime.fromtimestamp(near_ns / 1e9, UTC)
    at = datetime.combine(day or near.date(), moment.replace(tzinfo=None), UTC)
    if day is None:
        at = min((at + timedelta(days=shift) for shift in (-1, 0, 1)), key=lambda each: abs(each - near))
    since = at - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86_400 + since.seconds) * 1_000_000_000 + since.microseconds * 1000
