"""Validates one data packet of a Velodyne before it is decoded (manual of the VLP-16, 63-9243, section 9.3; the other
models of ``models`` send the same frame).

1206 bytes: twelve blocks of a flag FF EE, an azimuth and 32 returns, then the sensor's time (µs past the hour), the
return mode and the product. In dual return mode, two consecutive blocks hold the last and the strongest returns of the
same firings.

The decoding library trusts its input: an all-zero packet, or one with a corrupt last azimuth, makes it cut the sweep in
the middle. Packets that the sensor would not send are therefore rejected here, with a reason. A sensor that is set to
send only part of the circle produces one packet per rotation that spans the gap; it is rejected too, because its
azimuths do not advance evenly.
"""

from __future__ import annotations

from typing import NamedTuple

import numba

from pipeline.formats.velodyne.models import MODELS, PACKET_BYTES, VLP16, VelodyneModel

BLOCK_US = VLP16.block_us
"""Of a VLP-16: two rounds of the 16 lasers, 55.296 µs each."""
ROTATION_CDEG = 36_000
HOUR_US = 3_600_000_000

_NAMES = {each.product: each.name for each in MODELS} | {0x31: "Velarray", 0xA1: "VLS-128 (Alpha Prime)"}
_STRONGEST, _LAST, _DUAL = 0x37, 0x38, 0x39
_LOWER_BLOCK_OF_HDL64 = b"\xff\xdd"
_MIN_STEP_CDEG, _MAX_STEP_CDEG = 8.0, 100.0  # between blocks: 120 to 1500 rpm; the VLP-16 turns at 300 to 1200
_STEP_JITTER_CDEG = 12.0  # real packets: 3
_BLOCKS_A_PACKET = (12, 6)  # single, dual

_NO_FLAG, _OTHER_PRODUCT, _OTHER_MODE, _BEYOND_HOUR, _BEYOND_CIRCLE, _UNEVEN = range(1, 7)
_FAULTS = {
    _OTHER_MODE: "unknown return mode",
    _BEYOND_HOUR: "time beyond the hour",
    _BEYOND_CIRCLE: "azimuth of 360° or more",
    _UNEVEN: "azimuths do not advance evenly",
}


class BadPacket(Exception):
    """Not a packet of the sensor. The text is the reason, the same words for the same reason, so it can be counted.
    model: the other Velodyne that it comes from, where it names one."""

    def __init__(self, reason: str, model: str | None = None) -> None:
        super().__init__(reason)
        self.reason, self.model = reason, model


class Packet(NamedTuple):
    """A data packet that passed the checks."""

    time_us: int
    """Past the hour, when the first block's first laser fired."""
    azimuth_cdeg: int
    """Of the first block: hundredths of a degree, clockwise from straight ahead."""
    rate_cdeg_us: float
    """How fast the head turns."""
    span_us: float
    """From this packet's first firing to the next packet's."""
    dual: bool
    """Two returns per firing."""
    data: bytes
    """All 1206 bytes."""


def read_packet(data: bytes, model: VelodyneModel = VLP16) -> Packet:
    """What the packet says about itself. BadPacket with the reason when it is not a whole, plausible one of the model.

    A mutated range or reflectivity cannot be recognised; UDP's checksum guards against those.
    """
    if len(data) != PACKET_BYTES:
        raise BadPacket(f"not {PACKET_BYTES} bytes")
    fault, time_us, azimuth_cdeg, rate_cdeg_us, dual = _inspect(data, model.product, model.block_us)
    if fault:
        raise _bad_packet(fault, data, model)
    return Packet(time_us, azimuth_cdeg, rate_cdeg_us, _BLOCKS_A_PACKET[dual] * model.block_us, dual, data)


def warm_up() -> None:
    """Compile what looks at packets."""
    _inspect(bytes(PACKET_BYTES), VLP16.product, VLP16.block_us)


@numba.njit(cache=True, nogil=True)
def _inspect(data, product, block_us):  # type: ignore[no-untyped-def]  # pragma: no cover
    """(fault, time_us, azimuth_cdeg, rate_cdeg_us, dual) of 1206 bytes; fault 0 for none. Compiled: 150 packets of a
    sweep in dual return mode would take Python as long as decoding them."""
    nothing = 0, 0, 0.0, False
    for block in range(12):
        if data[block * 100] != 0xFF or data[block * 100 + 1] != 0xEE:
            return _NO_FLAG, *nothing
    mode = data[1204]
    if data[1205] != product:
        return _OTHER_PRODUCT, *nothing
    if mode != _STRONGEST and mode != _LAST and mode != _DUAL:
        return _OTHER_MODE, *nothing
    time_us = data[1200] + (data[1201] << 8) + (data[1202] << 16) + (data[1203] << 24)
    if time_us >= HOUR_US:
        return _BEYOND_HOUR, *nothing
    for block in range(12):
        if data[block * 100 + 2] + (data[block * 100 + 3] << 8) >= ROTATION_CDEG:
            return _BEYOND_CIRCLE, *nothing
    dual = mode == _DUAL
    if dual:
        for block in range(0, 12, 2):
            at = block * 100
            if data[at + 2] != data[at + 102] or data[at + 3] != data[at + 103]:
                return _UNEVEN, *nothing
    stride = 200 if dual else 100
    steps = 1200 // stride - 1
    first = data[2] + (data[3] << 8)
    last = data[steps * stride + 2] + (data[steps * stride + 3] << 8)
    mean = ((last - first) % ROTATION_CDEG) / steps
    if not _MIN_STEP_CDEG <= mean <= _MAX_STEP_CDEG:
        return _UNEVEN, *nothing
    before = first
    for step in range(1, steps + 1):
        azimuth = data[step * stride + 2] + (data[step * stride + 3] << 8)
        if not mean - _STEP_JITTER_CDEG <= (azimuth - before) % ROTATION_CDEG <= mean + _STEP_JITTER_CDEG:
            return _UNEVEN, *nothing
        before = azimuth
    return 0, time_us, first, mean / block_us, dual


def _bad_packet(fault: int, data: bytes, model: VelodyneModel) -> BadPacket:
    """A fault in words."""
    if fault == _NO_FLAG:
        return _bad_flags(data, model)
    if fault == _OTHER_PRODUCT:
        other = _NAMES.get(data[1205])
        return BadPacket(f"not a {model.name} but {other or f'unknown product {data[1205]:#04x}'}", other)
    return BadPacket(_FAULTS[fault])


def _bad_flags(data: bytes, model: VelodyneModel) -> BadPacket:
    if not any(data):
        return BadPacket("all zero")
    if any(data[at : at + 2] == _LOWER_BLOCK_OF_HDL64 for at in range(0, 1200, 100)):
        return BadPacket(f"not a {model.name} but HDL-64E", "HDL-64E")
    return BadPacket("block without its flag FF EE")
