"""An RTSP camera for tests, with what goes wrong with real ones: H.264 by PyAV or JPEG by OpenCV, sent within the
connection (RFC 2326, RFC 6184, RFC 2435). 640×360 at 30 Hz, grey with a white bar at the left, 100 pixels wide."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Literal

import av
import cv2
import numpy as np

WIDTH, HEIGHT, BAR_PX, GREY = 640, 360, 100, 80
_LARGEST_PART, _FRAGMENT, _FIRST, _LAST = 1400, 28, 0x80, 0x40
_SDP = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=x\r\nt=0 0\r\nm=video 0 RTP/AVP {}\r\n{}a=control:track1\r\n"
_RTP_KINDS = {"h264": 96, "mjpeg": 26}
_ABOUT_H264 = "a=rtpmap:96 H264/90000\r\na=fmtp:96 packetization-mode=1\r\n"
_420, _OWN_TABLES = 1, 255
"""Of RFC 2435: chroma at half the resolution; quantization tables come with each image."""

Codec = Literal["h264", "mjpeg"]
Behaviour = Literal["well", "stalls", "noise", "damaged", "without end", "another size", "closes"]


def encoded(width: int = WIDTH, height: int = HEIGHT, count: int = 30) -> list[bytes]:
    """Images as the camera's encoder makes them; every fifteenth can be decoded without others."""
    context = av.CodecContext.create("libx264", "w")
    assert isinstance(context, av.VideoCodecContext)
    context.width, context.height, context.time_base, context.pix_fmt = width, height, Fraction(1, 30), "yuv420p"
    context.options = {"preset": "ultrafast", "tune": "zerolatency", "g": "15", "bf": "0"}
    frames = [av.VideoFrame.from_ndarray(_pixels(width, height), "bgr24") for _ in range(count)]
    return [bytes(packet) for frame in frames for packet in context.encode(frame)]


def _pixels(width: int, height: int) -> np.ndarray:
    pixels = np.full((height, width, 3), GREY, np.uint8)
    pixels[:, :BAR_PX] = 255
    return pixels


def jpeg_parts(width: int = WIDTH, height: int = HEIGHT) -> list[bytes]:
    """Payloads of the packets of one JPEG, which hold what differs between JPEGs: size, tables and the scan."""
    jpeg = cv2.imencode(".jpg", _pixels(width, height))[1].tobytes()
    tables, at = b"", 2
    while (marker := jpeg[at + 1]) != 0xDA:  # segments, up to the scan
        (length,) = struct.unpack_from(">H", jpeg, at + 2)
        tables += jpeg[at + 5 : at + 2 + length] if marker == 0xDB else b""
        at += 2 + length
    scan = jpeg[at + 2 + struct.unpack_from(">H", jpeg, at + 2)[0] : -2]
    about = struct.pack(">BBBB", _420, _OWN_TABLES, width // 8, height // 8)
    return [
        struct.pack(">I", begin) + about + (struct.pack(">HH", 0, len(tables)) + tables if begin == 0 else b"")
        + scan[begin : begin + _LARGEST_PART]
        for begin in range(0, len(scan), _LARGEST_PART)
    ]  # fmt: skip


class RtspCamera:
    """Listens on a port of 127.0.0.1. ``does`` may be changed at any time. clients: how many have come so far."""

    def __init__(self, port: int, codec: Codec = "h264") -> None:
        self.does: Behaviour = "well"
        self.clients = 0
        self.codec = codec
        self._sizes = encoded(), encoded(WIDTH // 2, HEIGHT // 2)
        self.jpeg = jpeg_parts()
        self._ended = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", port))
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Its clients lose it too."""
        self._ended.set()
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client = self._listener.accept()[0]
                self.clients += 1
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError):
            client.settimeout(60.0)
            if _answered(client, self.codec):
                _Sender(client, self._ended, _RTP_KINDS[self.codec]).send_all(self)

    def image(self, number: int) -> bytes:
        size = self._sizes[self.does == "another size"]
        return size[number % len(size)]


class _Sender:
    """Sends images in packets of RTP within the connection."""

    def __init__(self, client: socket.socket, ended: threading.Event, kind: int) -> None:
        self._client, self._ended, self._sequence, self._kind = client, ended, 0, kind

    def send_all(self, camera: RtspCamera) -> None:
        number = 0
        while not self._ended.wait(1.0 / 30.0) and camera.does != "closes":
            stamp = int(time.monotonic() * 90_000)
            if camera.does == "noise":
                self._client.sendall(np.random.default_rng(number).bytes(3000))
            elif camera.does == "damaged":
                self._send(np.random.default_rng(number).bytes(1000), stamp, is_last=True)
            elif camera.does == "without end":
                for _ in range(200):
                    self._send(bytes([0x7C, 0x05]) + bytes(_LARGEST_PART), 1, is_last=False)
            elif camera.does == "well" and camera.codec == "mjpeg":
                for part in camera.jpeg:
                    self._send(part, stamp, is_last=part is camera.jpeg[-1])
            elif camera.does != "stalls":
                self._send_image(camera.image(number), stamp)
            number += 1

    def _send_image(self, image: bytes, stamp: int) -> None:
        units = [unit for unit in image.replace(b"\0\0\0\1", b"\0\0\1").split(b"\0\0\1") if unit]
        for unit in units:
            is_last = unit is units[-1]
            if len(unit) <= _LARGEST_PART:
                self._send(unit, stamp, is_last=is_last)
                continue
            for at in range(1, len(unit), _LARGEST_PART):
                ends = at + _LARGEST_PART >= len(unit)
                place = (_FIRST if at == 1 else 0) | (_LAST if ends else 0)
                head = bytes([(unit[0] & 0xE0) | _FRAGMENT, (unit[0] & 0x1F) | place])
                self._send(head + unit[at : at + _LARGEST_PART], stamp, is_last=is_last and ends)

    def _send(self, payload: bytes, stamp: int, *, is_last: bool) -> None:
        self._sequence += 1
        kind = self._kind | (0x80 if is_last else 0)
        head = struct.pack(">BBHII", 0x80, kind, self._sequence & 0xFFFF, stamp & 0xFFFF_FFFF, 1)
        self._client.sendall(b"$\0" + struct.pack(">H", len(head) + len(payload)) + head + payload)


def _answered(client: socket.socket, codec: Codec) -> bool:
    """Answer requests until the client asks to play; false if it leaves before."""
    with client.makefile("rb") as lines:
        while words := lines.readline().decode("latin-1").split():
            number = "0"
            while line := lines.readline().decode("latin-1").strip():
                name, _, value = line.partition(":")
                number = value.strip() if name.lower() == "cseq" else number
            answer, body = f"RTSP/1.0 200 OK\r\nCSeq: {number}\r\nSession: 1\r\n", ""
            if words[0] == "OPTIONS":
                answer += "Public: DESCRIBE, SETUP, PLAY\r\n"
            elif words[0] == "DESCRIBE":
                body = _SDP.format(_RTP_KINDS[codec], _ABOUT_H264 if codec == "h264" else "")
                answer += (
                    f"Content-Base: {words[1]}/\r\nContent-Type: application/sdp\r\nContent-Length: {len(body)}\r\n"
                )
            elif words[0] == "SETUP":
                answer += "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"
            client.sendall(f"{answer}\r\n{body}".encode("latin-1"))
            if words[0] == "PLAY":
                return True
    return False


@contextmanager
def rtsp_camera(port: int, codec: Codec = "h264") -> Iterator[RtspCamera]:
    """A camera that is plugged in, and unplugged at the end."""
    camera = RtspCamera(port, codec)
    try:
        yield camera
    finally:
        camera.close()
