"""One data packet of a VLP-16, looked at before anything is decoded (Velodyne manual 63-9243, section 9.3).

1206 bytes: twelve blocks of a flag FF EE, an azimuth and 32 returns, then the sensor's time (µs past the hour), the
return mode and the product. In dual return mode two blocks in a row hold the last and the strongest returns of the
same firings.

The decoding library takes what it is given: an all-zero packet, or one whose last azimuth is spoiled, makes it cut the
sweep in the middle. So a packet that is not what a VLP-16 sends is refused here, with the reason. A sensor set to send
a part of the circle only makes one packet a rotation that reaches over the gap; that one is refused too, for its
azimuths do not advance evenly.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

PACKET_BYTES = 1206
BLOCK_US = 110.592
"""Two rounds of the 16 lasers, 55.296 µs each."""
ROTATION_CDEG = 36_000
HOUR_US = 3_600_000_000

_LAYOUT = struct.Struct("<" + "HH96x" * 12 + "IBB")
_FLAG = 0xEEFF
_FLAGS = (_FLAG,) * 12
_VLP16 = 0x22
_OTHER_MODELS = {0x21: "HDL-32E", 0x24: "Puck Hi-Res", 0x28: "VLP-32C", 0x31: "Velarray", 0xA1: "VLS-128 (Alpha Prime)"}
_STRONGEST, _LAST, _DUAL = 0x37, 0x38, 0x39
_LOWER_BLOCK_OF_HDL64 = 0xDDFF
_MIN_STEP_CDEG, _MAX_STEP_CDEG = 8.0, 100.0  # between blocks: 120 to 1500 rpm; the VLP-16 turns at 300 to 1200
_STEP_JITTER_CDEG = 12.0  # real packets: 3


class BadPacket(Exception):
    """Not a packet of a VLP-16. The text is the reason, the same words for the same reason, so it can be counted.
    model: the other Velodyne that it comes from, where it names one."""

    def __init__(self, reason: str, model: str | None = None) -> None:
        super().__init__(reason)
        self.reason, self.model = reason, model


class Packet(NamedTuple):
    """time_us: past the hour, when the first block's first laser fired. azimuth_cdeg: of the first block, hundredths of
    a degree, clockwise from straight ahead. rate_cdeg_us: how fast the head turns. span_us: time from it to the
    next. data: all 1206 bytes."""

    time_us: int
    azimuth_cdeg: int
    rate_cdeg_us: float
    span_us: float
    dual: bool
    data: bytes


def read_packet(data: bytes) -> Packet:
    """What the packet says about itself. BadPacket with the reason when it is not a whole, plausible one of a VLP-16.

    A mutated range or reflectivity cannot be told from a true one; UDP's checksum guards those.
    """
    if len(data) != PACKET_BYTES:
        raise BadPacket(f"not {PACKET_BYTES} bytes")
    fields = _LAYOUT.unpack(data)
    time_us, mode, product = fields[24:]
    if fields[0:24:2] != _FLAGS:
        raise _bad_flags(data, fields)
    if product != _VLP16:
        model = _OTHER_MODELS.get(product)
        raise BadPacket(f"not a VLP-16 but {model or 'another product'}", model)
    if mode not in (_STRONGEST, _LAST, _DUAL):
        raise BadPacket("unknown return mode")
    if time_us >= HOUR_US:
        raise BadPacket("time beyond the hour")
    azimuths = fields[1:24:2]
    if max(azimuths) >= ROTATION_CDEG:
        raise BadPacket("azimuth of 360° or more")
    dual = mode == _DUAL
    if dual:
        if azimuths[0::2] != azimuths[1::2]:
            raise BadPacket("azimuths do not advance evenly")
        azimuths = azimuths[0::2]
    return Packet(time_us, azimuths[0], _rate(azimuths), len(azimuths) * BLOCK_US, dual, data)


def _rate(azimuths: tuple[int, ...]) -> float:
    """Hundredths of a degree per µs, from first to last firing. BadPacket unless every step is nearly the same."""
    steps = len(azimuths) - 1
    mean = ((azimuths[-1] - azimuths[0]) % ROTATION_CDEG) / steps
    if not _MIN_STEP_CDEG <= mean <= _MAX_STEP_CDEG:
        raise BadPacket("azimuths do not advance evenly")
    low, high = mean - _STEP_JITTER_CDEG, mean + _STEP_JITTER_CDEG
    before = azimuths[0]
    for azimuth in azimuths[1:]:
        if not low <= (azimuth - before) % ROTATION_CDEG <= high:
            raise BadPacket("azimuths do not advance evenly")
        before = azimuth
    return mean / BLOCK_US


def _bad_flags(data: bytes, fields: tuple[int, ...]) -> BadPacket:
    if not any(data):
        return BadPacket("all zero")
    if _LOWER_BLOCK_OF_HDL64 in fields[0:24:2]:
        return BadPacket("not a VLP-16 but HDL-64E", "HDL-64E")
    return BadPacket("block without its flag FF EE")
