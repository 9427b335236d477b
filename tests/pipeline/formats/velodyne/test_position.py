"""The sensor's position packet: whether its time is UTC."""

from __future__ import annotations

import contextlib
import functools
import operator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.formats.velodyne import POSITION_BYTES, BadPacket, read_position


def sentence(status: str) -> bytes:
    body = f"GPRMC,081802.00,{status},3649.7478558,N,00224.4542928,W,0.034,212.5,210116,0.0,E,A"
    return f"${body}*{functools.reduce(operator.xor, body.encode()):02X}\r\n".encode()


def position(time_us: int = 1_082_342_001, pps: int = 2, nmea: bytes = sentence("A")) -> bytes:
    data = bytearray(POSITION_BYTES)
    data[0xC6:0xCA] = time_us.to_bytes(4, "little")
    data[0xCA] = pps
    data[0xCE : 0xCE + len(nmea)] = nmea
    return bytes(data)


@pytest.mark.parametrize(
    ("data", "pps", "locked"),
    [
        (position(), "locked", True),
        (position(nmea=sentence("V")), "locked", False),
        (position(nmea=b""), "locked", False),
        (position(nmea=sentence("A").replace(b"0818", b"0918")), "locked", False),
        (position(pps=1), "synchronising", False),
        (position(pps=0, nmea=b""), "absent", False),
        (position(pps=3), "error", False),
    ],
    ids=["locked", "no fix", "no sentence", "wrong checksum", "synchronising", "nothing plugged in", "error"],
)
def test_state(data: bytes, pps: str, locked: bool) -> None:
    read = read_position(data)
    assert (read.pps, read.locked, read.time_us) == (pps, locked, 1_082_342_001)


@pytest.mark.parametrize("data", [b"", bytes(1206), position(pps=9), position(time_us=2**32 - 1)])
def test_refused(data: bytes) -> None:
    with pytest.raises(BadPacket):
        read_position(data)


@given(st.binary(min_size=POSITION_BYTES, max_size=POSITION_BYTES))
def test_anything_is_read_or_refused(data: bytes) -> None:
    with contextlib.suppress(BadPacket):
        assert read_position(data).time_us < 3_600_000_000
        assert data[0xCA] < 4
