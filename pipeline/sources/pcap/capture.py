"""The UDP datagrams of a capture file, one at a time, each with its position in the file so that it can be read again.

Classic pcap (libpcap's savefile format, µs and ns, either byte order) and pcapng (draft-ietf-opsawg-pcapng: section,
interface, enhanced and simple packet blocks). This module does not use dpkt, because it trusts a damaged length and
reads gigabytes for one packet, and because its floating-point times lose the nanoseconds.
"""

from __future__ import annotations

import os
import struct
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, NamedTuple

from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import open_regular
from pipeline.common.time_range import is_time
from pipeline.types.source import SourceError

_MAX_RECORD = 1 << 18
"""libpcap's own limit; a longer record is damaged."""
_CLASSIC = {
    b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
_SECTION, _INTERFACE, _ENHANCED = 0x0A0D0D0A, 1, 6
_BYTE_ORDER = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_LINK_BYTES = {0: 4, 1: 14, 12: 0, 14: 0, 101: 0, 108: 4, 113: 16, 228: 0, 229: 0, 276: 20}
"""Bytes before the IP header by link type: loopback, Ethernet, raw IP, Linux cooked."""
_ETHERNET, _VLAN = 1, (0x8100, 0x88A8)
_UDP = 17


class Datagram(NamedTuple):
    """One UDP datagram of a capture."""

    origin: int
    """Offset of its record in the file."""
    t_ns: int
    """Capture time, Unix time."""
    port: int
    """Destination port: distinguishes data from position packets."""
    payload: bytes
    """Without the UDP header."""


class _Interface(NamedTuple):
    """origin: offset of its description in the file; earlier packets do not belong to it. link: its type."""

    origin: int
    link: int
    tick_ns: float | int


class _Section(NamedTuple):
    """A section of a pcapng file with its own byte order and interfaces. origin: its offset."""

    origin: int
    order: str
    interfaces: list[_Interface]


class Capture:
    """One file. size: in bytes. damage: why reading ended before the end of the file, None if it did not."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: str | None = None
        with self._open() as file:
            head = file.read(12)
            self.size = file.seek(0, os.SEEK_END)
        self._magic = head[:4]
        self._sections = [_Section(0, _BYTE_ORDER.get(head[8:], "<"), [])]
        self._described_to = 0
        if self._magic not in _CLASSIC and self._magic != struct.pack("<I", _SECTION):
            raise SourceError(f"{path.name}: neither a pcap nor a pcapng file")

    def datagrams(self, begin: int = 0, end: int | None = None) -> Iterator[Datagram]:
        """Every complete UDP datagram whose record begins at ``begin`` (0: the first) to ``end``, both included.

        SourceError if the file can no longer be read.
        """
        with self._open() as file:
            records = self._classic(file, begin) if self._magic in _CLASSIC else self._pcapng(file, begin)
            for origin, t_ns, link, data in records:
                if end is not None and origin > end:
                    return
                found = _udp(data, link)
                if found is not None:
                    yield Datagram(origin, t_ns, *found)

    def beginnings(self) -> Iterator[tuple[int, int, bytes]]:
        """(destination port, length, beginning of the payload) of every UDP datagram, including fragmented ones.

        SourceError if the file can no longer be read.
        """
        with self._open() as file:
            records = self._classic(file, 0) if self._magic in _CLASSIC else self._pcapng(file, 0)
            for _, _, link, data in records:
                found = _udp_header(data, link)
                if found is not None:
                    port, length = struct.unpack_from(">HH", data, found[0] + 2)
                    yield port, length - 8, data[found[0] + 8 :]

    @contextmanager
    def _open(self) -> Iterator[BinaryIO]:
        try:
            with open_regular(self.path) as file:
                yield file
        except OSError as error:
            raise SourceError(f"{self.path.name}: cannot be read: {reason_of(error)}") from None

    def _classic(self, file: BinaryIO, begin: int) -> Iterator[tuple[int, int, int, bytes]]:
        order, tick_ns = _CLASSIC[self._magic]
        header = file.read(24)
        if len(header) < 24:
            self.damage = "cut off in its header"
            return
        (link,) = struct.unpack_from(order + "I", header, 20)
        record = struct.Struct(order + "IIII")
        origin = max(begin, 24)
        file.seek(origin)
        while head := file.read(16):
            if len(head) < 16:
                self.damage = f"cut off after {origin} bytes"
                return
            seconds, ticks, length, _ = record.unpack(head)
            if not 0 < length <= _MAX_RECORD:  # none is empty; a disk that filled up leaves gigabytes of zeros
                self.damage = f"damaged after {origin} bytes"
                return
            data = file.read(length)
            if len(data) < length:
                self.damage = f"cut off after {origin} bytes"
                return
            yield origin, seconds * 1_000_000_000 + ticks * tick_ns, link & 0xFFFF, data
            origin += 16 + length

    def _pcapng(self, file: BinaryIO, begin: int) -> Iterator[tuple[int, int, int, bytes]]:
        """Packets from ``begin`` on. Earlier sections and interfaces are known from the first pass over the file; parts
        that have not been read yet are scanned."""
        origin = min(begin, self._described_to)
        file.seek(origin)
        while head := file.read(12):
            if len(head) < 12:
                self.damage = f"cut off after {origin} bytes"
                return
            section, is_new = self._section_at(origin), origin >= self._described_to
            if head[:4] == self._magic and origin > section.origin:
                section = _Section(origin, _BYTE_ORDER.get(head[8:12], "<"), [])
            kind, length = struct.unpack(section.order + "II", head[:8])
            if length < 12 or length % 4 or length > _MAX_RECORD:
                self.damage = f"damaged after {origin} bytes"
                return
            body = head[8:] + file.read(length - 12)
            if len(body) < length - 8:
                self.damage = f"cut off after {origin} bytes"
                return
            if kind == _SECTION and is_new and origin > 0:
                self._sections.append(section)
            elif kind == _INTERFACE and is_new and len(body) >= 12:
                (link,) = struct.unpack_from(section.order + "H", body)
                section.interfaces.append(_Interface(origin, link, _resolution_ns(body[8:-4], section.order)))
            elif kind == _ENHANCED and len(body) >= 24 and origin >= begin:
                number, high, low, captured = struct.unpack_from(section.order + "IIII", body)
                if number < len(section.interfaces) and section.interfaces[number].origin < origin:
                    _, link, tick_ns = section.interfaces[number]
                    t_ns = round((high << 32 | low) * tick_ns)
                    if is_time(t_ns):
                        yield origin, t_ns, link, body[20 : 20 + captured]
            origin += length
            self._described_to = max(self._described_to, origin)

    def _section_at(self, origin: int) -> _Section:
        return self._sections[bisect_right(self._sections, origin, key=lambda section: section.origin) - 1]


def _resolution_ns(options: bytes, order: str) -> float | int:
    """Nanoseconds per tick of an interface's timestamps: option if_tsresol, µs without it."""
    at = 0
    while at + 4 <= len(options):
        code, length = struct.unpack_from(order + "HH", options, at)
        if code == 9 and length == 1 and at + 4 < len(options):
            power = options[at + 4]
            ticks_a_second = 2 ** (power & 0x7F) if power & 0x80 else 10**power
            return 1_000_000_000 // ticks_a_second if 1_000_000_000 % ticks_a_second == 0 else 1e9 / ticks_a_second
        if code == 0:
            break
        at += 4 + (length + 3) // 4 * 4
    return 1000


def _udp(data: bytes, link: int) -> tuple[int, bytes] | None:
    """(destination port, payload) of a frame with one complete UDP datagram; None for others."""
    found = _udp_header(data, link)
    if found is None or found[1]:
        return None
    at, _ = found
    length = int.from_bytes(data[at + 4 : at + 6], "big")
    if length < 8 or at + length > len(data):
        return None
    return int.from_bytes(data[at + 2 : at + 4], "big"), data[at + 8 : at + length]


def _udp_header(data: bytes, link: int) -> tuple[int, bool] | None:
    """Offset of a UDP datagram's header in a frame, and whether the datagram is fragmented; None for a frame without
    one."""
    at = _LINK_BYTES.get(link)
    if at is None or len(data) < at + 28:
        return None
    if link == _ETHERNET:
        while int.from_bytes(data[at - 2 : at], "big") in _VLAN and at + 4 + 28 <= len(data):
            at += 4
    version, is_part = data[at] >> 4, False
    if version == 4:
        fragment = int.from_bytes(data[at + 6 : at + 8], "big")
        if data[at + 9] != _UDP or fragment & 0x1FFF:
            return None
        is_part = bool(fragment & 0x2000)
        at += (data[at] & 0x0F) * 4
    elif version == 6 and data[at + 6] == _UDP:
        at += 40
    else:
        return None
    return (at, is_part) if at + 8 <= len(data) else None
