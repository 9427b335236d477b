"""One packet, looked at before anything is decoded."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.formats.velodyne import PACKET_BYTES, BadPacket, read_packet
from tests.pipeline.formats.velodyne.streams import MODE, PRODUCT, drive, stamped, with_azimuth, with_byte

GOOD = drive(1)[10][0]
DUAL = with_byte(GOOD, MODE, 0x39)
for pair in range(0, 12, 2):
    DUAL = with_azimuth(DUAL, pair + 1, int.from_bytes(DUAL[pair * 100 + 2 : pair * 100 + 4], "little"))

REFUSED = {
    "empty": (b"", "not 1206 bytes", None),
    "cut": (GOOD[:1205], "not 1206 bytes", None),
    "a position packet": (bytes(512), "not 1206 bytes", None),
    "all zero": (bytes(PACKET_BYTES), "all zero", None),
    "a block without its flag": (with_byte(GOOD, 500, 0), "block without its flag FF EE", None),
    "HDL-64E": (with_byte(GOOD, 101, 0xDD), "not a VLP-16 but HDL-64E", "HDL-64E"),
    "HDL-32E": (with_byte(GOOD, PRODUCT, 0x21), "not a VLP-16 but HDL-32E", "HDL-32E"),
    "Puck Hi-Res": (with_byte(GOOD, PRODUCT, 0x24), "not a VLP-16 but Puck Hi-Res", "Puck Hi-Res"),
    "VLP-32C": (with_byte(GOOD, PRODUCT, 0x28), "not a VLP-16 but VLP-32C", "VLP-32C"),
    "VLS-128": (
        with_byte(GOOD, PRODUCT, 0xA1),
        "not a VLP-16 but VLS-128 (Alpha Prime)",
        "VLS-128 (Alpha Prime)",
    ),
    "nobody's product": (with_byte(GOOD, PRODUCT, 0x77), "not a VLP-16 but unknown product 0x77", None),
    "return mode": (with_byte(GOOD, MODE, 0x36), "unknown return mode", None),
    "time": (stamped(GOOD, 3_600_000_000), "time beyond the hour", None),
    "azimuth of 360°": (with_azimuth(GOOD, 3, 36_000), "azimuth of 360° or more", None),
    "azimuth of the last block": (with_azimuth(GOOD, 11, 100), "azimuths do not advance evenly", None),
    "azimuth in between": (with_azimuth(GOOD, 5, 18_000), "azimuths do not advance evenly", None),
    "a head that stands": (b"".join([GOOD[:100]] * 12) + GOOD[1200:], "azimuths do not advance evenly", None),
    "single azimuths, dual mode": (with_byte(GOOD, MODE, 0x39), "azimuths do not advance evenly", None),
    "dual azimuths, single mode": (with_byte(DUAL, MODE, 0x37), "azimuths do not advance evenly", None),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name: str) -> None:
    data, reason, model = REFUSED[name]
    with pytest.raises(BadPacket) as refused:
        read_packet(data)
    assert (refused.value.reason, refused.value.model) == (reason, model)


@pytest.mark.parametrize(
    ("data", "dual", "span_us"), [(GOOD, False, 12 * 110.592), (DUAL, True, 6 * 110.592)], ids=["single", "dual"]
)
def test_accepted(data: bytes, dual: bool, span_us: float) -> None:
    packet = read_packet(data)
    assert (packet.dual, packet.data) == (dual, data)
    assert packet.span_us == pytest.approx(span_us)
    assert packet.azimuth_cdeg == 18_000 + 10 * 480


def test_rate_is_that_of_the_head() -> None:
    turns_a_minute = read_packet(GOOD).rate_cdeg_us * 60e6 / 36_000
    assert turns_a_minute == pytest.approx(603, abs=1)


@given(st.one_of(st.binary(max_size=1300), st.binary(min_size=PACKET_BYTES, max_size=PACKET_BYTES)))
def test_anything_is_read_or_refused(data: bytes) -> None:
    with suppress(BadPacket):
        assert read_packet(data).data == data
