"""Datagrams with the moment at which the system received them, however long this program took to look."""

from __future__ import annotations

import contextlib
import errno
import socket
import struct
import sys
import time
from collections.abc import Callable

from pipeline.sources.live.devices.device_reader import POLL_S, DeviceLost, Stop

_SO_TIMESTAMPNS = 35
"""Linux: receive times with every datagram (socket(7)); Python has no name for it."""
_TIMESPEC = struct.Struct("qq")
_BUFFER_BYTES = 4 << 20
"""About four seconds of a VLP-16."""
_LARGEST = 65_535

Receive = Callable[[bytes, int], None]
"""Takes a datagram and the system's clock when it came, nanoseconds since 1970."""


def read_datagrams(port: int, interface: str, group: str | None, receive: Receive, stop: Stop) -> None:
    """Listen until ``stop``. DeviceLost names the port when it cannot be listened on."""
    with _listening(port, interface, group) as bound:
        while not stop:
            with contextlib.suppress(TimeoutError):
                data, ancillary, _, _ = bound.recvmsg(_LARGEST, socket.CMSG_SPACE(_TIMESPEC.size))
                receive(data, _received_at(ancillary))


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


def _received_at(ancillary: list[tuple[int, int, bytes]]) -> int:
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS and len(data) >= _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack_from(data)
            return int(seconds * 1_000_000_000 + nanoseconds)
    return time.time_ns()
