"""MJPEG over HTTP (multipart/x-mixed-replace), read with the standard library. Every JPEG is kept unchanged, and so is
the timestamp that many cameras send with it, which video libraries drop."""

from __future__ import annotations

import contextlib
import http.client
import math
import socket
import time
from collections.abc import Callable, Mapping
from urllib.parse import urlsplit

from pipeline.common.time_range import END_OF_TIME_NS
from pipeline.sources.live.devices.device_reader import CONNECT_S, SILENCE_S, DeviceLost, ReaderStop

PART_S = 3.0
"""Longest time from a part's first byte to its last. A camera that sends one image in 1.5 s, the slowest that is not
taken for silent, needs half of it."""
_LARGEST, _AT_ONCE = 32 << 20, 1 << 16
_LONGEST_LINE = 8192
_MOST_LINES = 100
"""Maximum lines between two images: a part has a handful of headers."""
_JPEG_END = b"\xff\xd9"
_STAMPS = ("x-timestamp", "x-sendtimestamp")
"""Headers with seconds since 1970, as sent by mjpg-streamer, µStreamer and others."""

ReceiveImage = Callable[[bytes, int | None], None]
"""Takes a JPEG and its timestamp, µs since 1970, if it has one."""


class _Stopped(Exception):
    """Asked to stop in the middle of a part."""


class NotMjpeg(Exception):
    """The address responds with something other than MJPEG."""


def read_mjpeg(url: str, receive: ReceiveImage, stop: ReaderStop) -> None:
    """Read until ``stop``. DeviceLost if the camera cannot be reached, disconnects, falls silent or takes too long for
    an image; NotMjpeg if the address does not serve MJPEG."""
    connection = _connection(url)
    try:
        parts = urlsplit(url)
        connection.connect()
        connection.sock.settimeout(SILENCE_S)
        stop.device = _Wire(connection.sock)
        connection.request("GET", (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
        with connection.getresponse() as response:
            if response.status != http.client.OK:
                raise DeviceLost(f"{url}: HTTP {response.status} {response.reason}")
            if not response.headers.get_content_type().startswith("multipart/"):
                raise NotMjpeg
            body = _Body(response, url, stop)
            while not stop:
                receive(*_next_part(body))
    except _Stopped:
        return
    except TimeoutError:
        raise DeviceLost(f"{url}: no response") from None
    except (http.client.HTTPException, ValueError) as error:
        raise DeviceLost(f"{url}: unexpected response: {type(error).__name__}") from None
    except OSError as error:
        raise DeviceLost(f"{url}: {error.strerror or error}") from None
    finally:
        connection.close()


class _Wire:
    """A connection that somebody reads. A reader that waits for bytes continues only if it is shut down."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)


class _Body:
    """The bytes of a response, as they come. Each read raises _Stopped when asked to stop, and DeviceLost at the end of
    the response, or if the current part takes longer than ``PART_S``."""

    def __init__(self, response: http.client.HTTPResponse, url: str, stop: ReaderStop) -> None:
        self.url = url
        self._response, self._stop = response, stop
        self._held = bytearray()
        self._began_s = 0.0

    def begin_part(self) -> None:
        """A part begins with the next byte."""
        self._began_s = math.inf if not self._held else time.monotonic()

    def line(self) -> bytes:
        """The next line with its end, or as much of it as is permitted."""
        searched = 0
        while (end := self._held.find(b"\n", searched, _LONGEST_LINE)) < 0 and len(self._held) < _LONGEST_LINE:
            searched = len(self._held)
            self._receive()
        return self._take(end + 1 if end >= 0 else _LONGEST_LINE)

    def exactly(self, count: int) -> bytes:
        while len(self._held) < count:
            self._receive()
        return self._take(count)

    def until(self, mark: bytes, most: int) -> bytes:
        """Up to and with ``mark``, or ``most`` bytes without it."""
        searched = 0
        while (at := self._held.find(mark, searched)) < 0 and len(self._held) < most:
            searched = max(0, len(self._held) - len(mark) + 1)
            self._receive()
        return self._take(at + len(mark) if at >= 0 else most)

    def _take(self, count: int) -> bytes:
        taken = bytes(memoryview(self._held)[:count])
        del self._held[:count]
        return taken

    def _receive(self) -> None:
        if self._stop:
            raise _Stopped
        data = self._response.read1(_AT_ONCE)
        if not data:
            raise DeviceLost(f"{self.url}: the camera closed the connection")
        now_s = time.monotonic()
        self._began_s = min(self._began_s, now_s)
        if now_s - self._began_s > PART_S:
            raise DeviceLost(f"{self.url}: an image takes longer than {PART_S:g} s")
        self._held += data


def _connection(url: str) -> http.client.HTTPConnection:
    try:
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        return kind(parts.hostname or "", parts.port, timeout=CONNECT_S)
    except ValueError:
        raise DeviceLost(f"{url}: not an address") from None


def _next_part(body: _Body) -> tuple[bytes, int | None]:
    """One JPEG: its headers contain its length; otherwise it is read up to the JPEG's end marker."""
    body.begin_part()
    headers = _headers(body)
    length = headers.get("content-length", "")
    if length.isdecimal() and 0 < int(length) <= _LARGEST:
        return body.exactly(int(length)), _stamp_us(headers)
    return body.until(_JPEG_END, _LARGEST), _stamp_us(headers)


def _headers(body: _Body) -> Mapping[str, str]:
    """Headers of the next part: lines after its boundary, up to an empty one. DeviceLost if they do not end."""
    headers: dict[str, str] = {}
    for _ in range(_MOST_LINES):
        line = body.line()
        if len(line) == _LONGEST_LINE:
            break
        if line in (b"\r\n", b"\n"):
            if headers:
                return headers
            continue
        name, colon, value = line.decode("latin-1").partition(":")
        if colon:
            headers[name.strip().lower()] = value.strip()
    raise DeviceLost(f"{body.url}: unexpected response: headers without end")


def _stamp_us(headers: Mapping[str, str]) -> int | None:
    for name in _STAMPS:
        try:
            stamp_us = round(float(headers[name]) * 1e6)
        except (KeyError, ValueError, OverflowError):
            continue
        if 0 < stamp_us < END_OF_TIME_NS // 1000:
            return stamp_us
    return None
