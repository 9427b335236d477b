"""Records every address that a program and its children connect to, whether from Python, a native library or another
program.

A seccomp filter on the thread that starts the program reports each system call with an address before the kernel runs
it (seccomp_unotify(2)). Needs Linux 5.5 or newer, but no privileges.
"""

from __future__ import annotations

import ctypes
import ipaddress
import os
import platform
import select
import socket
import struct
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fcntl import ioctl
from pathlib import Path
from typing import NamedTuple

_CALLS = {  # connect, sendto, sendmsg, sendmmsg; seccomp
    "x86_64": ((42, 44, 46, 307), 317),
    "aarch64": ((203, 206, 211, 269), 277),
}
_SET_NO_NEW_PRIVS, _SET_MODE_FILTER, _NEW_LISTENER = 38, 1, 8
_ALLOW, _NOTIFY = 0x7FFF0000, 0x7FC00000
_RECEIVE, _SEND, _CONTINUE = 0xC0502100, 0xC0182101, 1
_LONGEST_ADDRESS = 128


class Call(NamedTuple):
    """One address that was called."""

    program: str
    address: str
    port: int

    @property
    def leaves(self) -> bool:
        """Whether it goes to another machine, or asks a resolver on this one for a name."""
        return self.port == 53 or not ipaddress.ip_address(self.address).is_loopback


def cannot_watch() -> str | None:
    """Why this machine does not support it; None if it does."""
    if platform.system() != "Linux" or platform.machine() not in _CALLS:
        return "needs Linux on x86-64 or ARM64"
    return None if tuple(map(int, platform.release().split(".")[:2])) >= (5, 5) else "needs Linux 5.5"


@contextmanager
def watched(command: Sequence[str], **options: object) -> Iterator[tuple[subprocess.Popen[str], list[Call]]]:
    """The running program and the calls it has made so far, to IPv4 and IPv6 addresses. It is killed at the end."""
    calls: list[Call] = []
    started: list[subprocess.Popen[str]] = []
    listener: list[int] = []
    is_filtered, has_ended = threading.Event(), threading.Event()

    def start() -> None:
        listener.append(_filter_this_thread())
        is_filtered.set()
        started.append(subprocess.Popen(command, text=True, **options))  # type: ignore[call-overload]

    starter = threading.Thread(target=start)
    starter.start()
    assert is_filtered.wait(60)
    watcher = threading.Thread(target=_watch, args=(listener[0], calls, has_ended))
    watcher.start()
    starter.join()
    try:
        yield started[0], calls
    finally:
        started[0].kill()
        started[0].communicate()
        has_ended.set()
        watcher.join()
        os.close(listener[0])


def _filter_this_thread() -> int:
    numbers, seccomp = _CALLS[platform.machine()]
    notify = [struct.pack("HBBI", 0x15, len(numbers) - i, 0, number) for i, number in enumerate(numbers)]
    load = struct.pack("HBBI", 0x20, 0, 0, 0)  # the call's number
    answers = [struct.pack("HBBI", 0x06, 0, 0, answer) for answer in (_ALLOW, _NOTIFY)]
    program = b"".join((load, *notify, *answers))
    code = ctypes.create_string_buffer(program, len(program))
    header = ctypes.create_string_buffer(struct.pack("HxxxxxxP", len(program) // 8, ctypes.addressof(code)), 16)
    libc = ctypes.CDLL(None, use_errno=True)
    assert libc.prctl(_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
    listener: int = libc.syscall(seccomp, _SET_MODE_FILTER, _NEW_LISTENER, header)
    if listener < 0:
        raise OSError(ctypes.get_errno(), "seccomp")
    return listener


def _watch(listener: int, calls: list[Call], has_ended: threading.Event) -> None:
    poll = select.poll()
    poll.register(listener, select.POLLIN)
    while not has_ended.is_set():
        if not any(event & select.POLLIN for _, event in poll.poll(100)):
            continue
        asked = bytearray(80)
        try:
            ioctl(listener, _RECEIVE, asked)
        except OSError:
            continue  # the caller has exited meanwhile
        number, process, _, call = struct.unpack_from("QIIi", asked)
        found = _address_of(process, call, struct.unpack_from("6Q", asked, 32))
        if found is not None:
            calls.append(Call(_name_of(process), *found))
        try:
            ioctl(listener, _SEND, bytearray(struct.pack("QqiI", number, 0, 0, _CONTINUE)))
        except OSError:
            continue


def _address_of(process: int, call: int, arguments: tuple[int, ...]) -> tuple[str, int] | None:
    connect, sendto, _, _ = _CALLS[platform.machine()][0]
    try:
        with open(f"/proc/{process}/mem", "rb", buffering=0) as memory:

            def read(at: int, length: int) -> bytes:
                memory.seek(at)
                return memory.read(length)

            if call == connect:
                pointer, length = arguments[1], arguments[2]
            elif call == sendto:
                pointer, length = arguments[4], arguments[5]
            else:  # of several messages the first: a resolver sends all of them to one server
                pointer, length = struct.unpack("QI", read(arguments[1], 12))
            raw = read(pointer, min(length, _LONGEST_ADDRESS)) if pointer else b""
    except OSError:
        return None
    family = struct.unpack_from("H", raw)[0] if len(raw) >= 2 else socket.AF_UNSPEC
    port = struct.unpack_from(">H", raw, 2)[0] if len(raw) >= 4 else 0
    if family == socket.AF_INET and len(raw) >= 8:
        return socket.inet_ntop(family, raw[4:8]), port
    if family == socket.AF_INET6 and len(raw) >= 24:
        return socket.inet_ntop(family, raw[8:24]).removeprefix("::ffff:"), port
    return None


def _name_of(process: int) -> str:
    try:
        return Path(f"/proc/{process}/comm").read_text(encoding="utf-8").strip()
    except OSError:
        return str(process)
