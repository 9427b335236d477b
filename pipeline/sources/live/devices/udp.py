"""Receives datagrams with the time at which the system received them, however late this program reads them.

Once the sender is known, a socket filter (on Linux) makes the system drop nearly all data of other senders, so a flood
of it neither fills the socket's buffer nor takes this program's time. A few datagrams pass, to be counted and reported.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import socket
import struct
import sys
import time
from collections.abc import Callable
from typing import Protocol

from pipeline.sources.live.devices.device_reader import POLL_S, DeviceLost, ReaderStop
from pipeline.sources.live.devices.rate_limit import RateLimit
from pipeline.sources.live.devices.sender_pin import SocketAddress

_SO_TIMESTAMPNS = 35
"""Linux: receive timestamps for every datagram (socket(7)); Python defines no name for this constant, nor for the
next."""
_SO_ATTACH_FILTER = 26
_TIMESPEC = struct.Struct("qq")
_BUFFER_BYTES = 4 << 20
"""Buffer size: about four seconds of a VLP-16."""
_LARGEST = 65_535
_MOST_HZ, _PAUSE_S = 8_000, 0.02
"""Datagrams read in a second: five VLP-16 and the accepted part of a flood. Of a faster sender, who gives the sensor's
own address or comes before it, the system drops the rest while reading pauses."""
_ONE_OF = 32
"""Of other senders' datagrams, one in this many is accepted for inspection; a power of two. A second LiDAR sends 754 a
second and is noticed at once; a flood of 100,000 a second costs as much as four LiDARs."""

ReceiveDatagram = Callable[[bytes, int], None]
"""Takes a datagram and the system's time of its arrival, nanoseconds since 1970."""


class Pin(Protocol):
    """Decides whose datagrams are read. See ``sender_pin``."""

    @property
    def sender(self) -> SocketAddress | None: ...

    def takes(self, data: bytes, sender: SocketAddress, at_ns: int) -> bool: ...

    def nothing_came(self) -> None: ...


def read_datagrams(
    port: int, interface: str, group: str | None, receive: ReceiveDatagram, pin: Pin, stop: ReaderStop
) -> None:
    """Listen until ``stop``. DeviceLost names the port if it cannot be opened."""
    let_in: SocketAddress | None = None
    limit = RateLimit(_MOST_HZ)
    with _listening(port, interface, group) as bound:
        stop.device = bound  # a reader that hangs must not keep the port
        while not stop:
            if pin.sender != let_in:
                let_in = pin.sender
                _let_in(bound, let_in)
            if not limit.allows(1):
                stop.wait(_PAUSE_S)
                continue
            try:
                data, ancillary, _, sender = bound.recvmsg(_LARGEST, socket.CMSG_SPACE(_TIMESPEC.size))
            except TimeoutError:
                pin.nothing_came()
                continue
            at_ns = _received_at(ancillary)
            if pin.takes(data, sender, at_ns):
                receive(data, at_ns)


def _listening(port: int, interface: str, group: str | None) -> socket.socket:
    bound = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER_BYTES)
        if sys.platform == "linux":
            bound.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        bound.settimeout(POLL_S)
        if group is None:
            bound.bind((interface, port))
        else:
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            bound.bind((group if sys.platform == "linux" else "", port))
            membership = socket.inet_aton(group) + socket.inet_aton(interface)
            bound.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        bound.close()
        where = f"UDP port {port} on {interface}" + (f", group {group}" if group else "")
        if error.errno == errno.EADDRINUSE:
            raise DeviceLost(f"{where} is in use by another program") from None
        raise DeviceLost(f"cannot listen on {where}: {error.strerror or error}") from None
    return bound


def _let_in(bound: socket.socket, sender: SocketAddress | None) -> None:
    """Let the kernel drop datagrams of other senders, except one of ``_ONE_OF``; None accepts all senders. If that is
    not supported, ``Pin.takes`` alone decides."""
    if sys.platform != "linux":
        return
    program = _program(sender)
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *each) for each in program))
    with contextlib.suppress(OSError):
        told = struct.pack("HP", len(program), ctypes.addressof(code))
        bound.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, told)


def _program(sender: SocketAddress | None) -> list[tuple[int, int, int, int]]:
    """The filter in classic BPF (linux/Documentation/networking/filter.rst): operation, lines to skip if true and if
    false, operand. A datagram begins with its UDP header; the IP header has a separate offset."""
    load, load_half, masked, if_equal, end = 0x20, 0x28, 0x54, 0x15, 0x06
    source_host, source_port, random = 0xFFF0_0000 + 12, 0, 0xFFFF_F000 + 56
    whole, nothing = (end, 0, 0, 0xFFFF_FFFF), (end, 0, 0, 0)
    if sender is None:
        return [whole]
    host, port = int.from_bytes(socket.inet_aton(sender[0]), "big"), sender[1]
    tests = [(load_half, 0, 0, source_port), (if_equal, 3, 0, port)] if port else []
    to_sample, to_end = (0, len(tests)) if port else (3, 0)
    found = (if_equal, to_sample, to_end, host)
    sample = [(load, 0, 0, random), (masked, 0, 0, _ONE_OF - 1), (if_equal, 0, 1, 0)]
    return [(load, 0, 0, source_host), found, *tests, *sample, whole, nothing]


def _received_at(ancillary: list[tuple[int, int, bytes]]) -> int:
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS and len(data) >= _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack_from(data)
            return int(seconds * 1_000_000_000 + nanoseconds)
    return time.time_ns()
