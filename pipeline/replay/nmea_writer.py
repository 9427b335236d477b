"""Writes a fix as the NMEA sentences of a receiver: GGA, RMC and GST."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from pipeline.formats.nmea import KNOT_MPS
from pipeline.types import GnssFix

_QUALITY = {"single": 1, "dgnss": 2, "rtk_fixed": 4, "rtk_float": 5}


def sentences(fix: GnssFix, utc_ns: int) -> bytes:
    """Three sentences with time ``utc_ns``, to the hundredth of a second as from receivers."""
    rounded_ns = round(utc_ns / 1e7) * 10_000_000
    at = datetime.fromtimestamp(rounded_ns // 1_000_000_000, UTC)
    clock = f"{at:%H%M%S}.{rounded_ns % 1_000_000_000 // 10_000_000:02d}"
    place = f"{_angle(fix.lat_deg, 2, 'NS')},{_angle(fix.lon_deg, 3, 'EW')}"
    height = "" if math.isnan(fix.alt_m) else f"{fix.alt_m:.3f}"
    course = "" if fix.course_rad is None else f"{math.degrees(fix.course_rad) % 360.0:.3f}"
    bodies = (
        f"GPGST,{clock},,,,,{fix.sigma_m:.3f},{fix.sigma_m:.3f},{fix.sigma_m:.3f}",
        f"GPGGA,{clock},{place},{_QUALITY[fix.quality]},12,0.8,{height},M,0.0,M,,",
        f"GPRMC,{clock},A,{place},{fix.speed_mps / KNOT_MPS:.4f},{course},{at:%d%m%y},,,A",
    )
    return b"".join(_with_checksum(body) for body in bodies)


def _angle(degrees: float, width: int, signs: str) -> str:
    """Degrees and minutes with a resolution of 0.2 mm."""
    minutes = round(abs(degrees) * 60.0, 7)
    whole = int(minutes // 60)
    return f"{whole:0{width}d}{minutes - 60 * whole:010.7f},{signs[degrees < 0]}"


def _with_checksum(body: str) -> bytes:
    checksum = 0
    for byte in body.encode("ascii"):
        checksum ^= byte
    return f"${body}*{checksum:02X}\r\n".encode("ascii")
