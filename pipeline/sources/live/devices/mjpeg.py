"""MJPEG over HTTP (multipart/x-mixed-replace), read with the standard library. Every JPEG is kept unchanged, and so is
the timestamp that many cameras send with it, which video libraries drop."""

from __future__ import annotations

import http.client
from collections.abc import Callable, Mapping
from urllib.parse import urlsplit

from pipeline.common.time_range import END_OF_TIME_NS
from pipeline.sources.live.devices.device_reader import CONNECT_S, SILENCE_S, DeviceLost, ReaderStop

_LARGEST = 32 << 20
_LONGEST_LINE = 8192
_MOST_LINES = 100
"""Maximum lines between two images: a part has a handful of headers."""
_STAMPS = ("x-timestamp", "x-sendtimestamp")
"""Headers with seconds since 1970, as sent by mjpg-streamer, µStreamer and others."""

ReceiveImage = Callable[[bytes, int | None], None]
"""Takes a JPEG and its timestamp, µs since 1970, if it has one."""


class _Stopped(Exception):
    """Asked to stop in the middle of a part."""


class NotMjpeg(Exception):
    """The address responds with something other than MJPEG."""


def read_mjpeg(url: str, receive: ReceiveImage, stop: ReaderStop) -> None:
    """Read until ``stop``. DeviceLost if the camera cannot be reached, disconnects or falls silent; NotMjpeg if the
    address does not serve MJPEG."""
    connection = _connection(url)
    try:
        parts = urlsplit(url)
        connection.connect()
        connection.sock.settimeout(SILENCE_S)
        connection.request("GET", (parts.path or "/") + (f"?{parts.query}" if parts.query else ""))
        with connection.getresponse() as response:
            if response.status != http.client.OK:
                raise DeviceLost(f"{url}: HTTP {response.status} {response.reason}")
            if not response.headers.get_content_type().startswith("multipart/"):
                raise NotMjpeg
            while not stop:
                receive(*_next_part(response, url, stop))
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


def _connection(url: str) -> http.client.HTTPConnection:
    try:
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        return kind(parts.hostname or "", parts.port, timeout=CONNECT_S)
    except ValueError:
        raise DeviceLost(f"{url}: not an address") from None


def _next_part(response: http.client.HTTPResponse, url: str, stop: ReaderStop) -> tuple[bytes, int | None]:
    """One JPEG: its headers contain its length; otherwise it is read up to the JPEG's end marker."""
    headers = _headers(response, url, stop)
    length = headers.get("content-length", "")
    if length.isdecimal() and 0 < int(length) <= _LARGEST:
        data = response.read(int(length))
        if len(data) < int(length):
            raise DeviceLost(f"{url}: the camera closed the connection")
        return data, _stamp_us(headers)
    return _until_jpeg_end(response, url, stop), _stamp_us(headers)


def _headers(response: http.client.HTTPResponse, url: str, stop: ReaderStop) -> Mapping[str, str]:
    """Headers of the next part: lines after its boundary, up to an empty one. DeviceLost if they do not end."""
    headers: dict[str, str] = {}
    for _ in range(_MOST_LINES):
        line = _line(response, url, stop)
        if len(line) == _LONGEST_LINE:
            break
        if line in (b"\r\n", b"\n"):
            if headers:
                return headers
            continue
        name, colon, value = line.decode("latin-1").partition(":")
        if colon:
            headers[name.strip().lower()] = value.strip()
    raise DeviceLost(f"{url}: unexpected response: headers without end")


def _until_jpeg_end(response: http.client.HTTPResponse, url: str, stop: ReaderStop) -> bytes:
    data = bytearray()
    while not data.endswith(b"\xff\xd9") and len(data) < _LARGEST:
        line = _line(response, url, stop)
        end = line.find(b"\xff\xd9") if data or line.startswith(b"\xff\xd8") else -1
        data += line if end < 0 else line[: end + 2]
    return bytes(data)


def _line(response: http.client.HTTPResponse, url: str, stop: ReaderStop) -> bytes:
    """The next line with its end, or as much of it as is permitted."""
    if stop:
        raise _Stopped
    line = response.readline(_LONGEST_LINE)
    if not line:
        raise DeviceLost(f"{url}: the camera closed the connection")
    return line


def _stamp_us(headers: Mapping[str, str]) -> int | None:
    for name in _STAMPS:
        try:
            stamp_us = round(float(headers[name]) * 1e6)
        except (KeyError, ValueError, OverflowError):
            continue
        if 0 < stamp_us < END_OF_TIME_NS // 1000:
            return stamp_us
    return None
