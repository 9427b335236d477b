"""MJPEG over HTTP as cameras really send it: with and without lengths and stamps, and what is no camera at all."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import pytest

from pipeline.sources.live.devices import mjpeg
from pipeline.sources.live.devices.device_reader import DeviceLost, ReaderStop
from pipeline.sources.live.devices.mjpeg import NotMjpeg, read_mjpeg
from tests.pipeline.sources.live.bench import small_jpeg

MULTIPART = b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace;boundary=--x\r\n\r\n"


@contextmanager
def answering(answer: bytes | Callable[[socket.socket], None]) -> Iterator[str]:
    """A server that sends ``answer`` to its client, or does that with it, and closes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            client, _ = listener.accept()
            with client, suppress(ConnectionError):  # whoever asked may have heard enough
                client.settimeout(60.0)
                client.recv(65536)
                if isinstance(answer, bytes):
                    client.sendall(answer)
                else:
                    answer(client)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}/video?x=1"
        thread.join(60.0)


def received(answer: bytes) -> tuple[list[tuple[bytes, int | None]], Exception | None]:
    found: list[tuple[bytes, int | None]] = []
    with answering(answer) as url:
        try:
            read_mjpeg(url, lambda data, stamp: found.append((data, stamp)), ReaderStop())
        except (DeviceLost, NotMjpeg) as error:
            return found, error
    return found, None


def part(jpeg: bytes, *headers: str) -> bytes:
    return "\r\n".join(["--x", "Content-Type: image/jpeg", *headers, "", ""]).encode() + jpeg + b"\r\n"


@pytest.mark.parametrize(
    ("case", "headers", "stamp_us"),
    [
        ("length and stamp", lambda j: (f"Content-Length: {len(j)}", "X-Timestamp: 1.123456"), 1_123_456),
        ("length alone", lambda j: (f"Content-Length: {len(j)}",), None),
        ("neither", lambda j: (), None),
        ("stamp that is none", lambda j: (f"content-length: {len(j)}", "X-Timestamp: now"), None),
        ("length that is none", lambda j: ("Content-Length: -3",), None),
    ],
)  # fmt: skip
def test_images_come_as_they_are(case: str, headers: Callable[[bytes], tuple[str, ...]], stamp_us: int | None) -> None:
    images = [small_jpeg(shade) for shade in (10, 128, 250)]
    found, error = received(MULTIPART + b"".join(part(each, *headers(each)) for each in images))
    assert [data for data, _ in found] == images
    assert {stamp for _, stamp in found} == {stamp_us}
    assert isinstance(error, DeviceLost), "then the camera closed"


@pytest.mark.parametrize(
    ("case", "answer", "complaint"),
    [
        ("not found", b"HTTP/1.0 404 Not Found\r\n\r\n", "HTTP 404"),
        ("no HTTP", b"\x00\x01\x02\r\n\r\n", "unexpected response"),
        ("nothing", b"", "unexpected response"),
        ("cut in an image", MULTIPART + part(small_jpeg(), "Content-Length: 99999"), "closed the connection"),
        ("headers without end", MULTIPART + b"A: b\r\n" * 1000 + part(small_jpeg()), "headers without end"),
        ("a line without end", MULTIPART + b"A:" + b"b" * 100_000 + b"\n" + part(small_jpeg()), "headers without end"),
        ("garbage for parts", MULTIPART + bytes(range(256)) * 64, "closed the connection"),
    ],
)
def test_what_is_no_camera_is_said(case: str, answer: bytes, complaint: str) -> None:
    found, error = received(answer)
    assert found == []
    assert complaint in str(error)


@pytest.mark.parametrize("sent", [0, 20, 300], ids=["before the headers", "among the headers", "in the image"])
def test_it_ends_when_asked_in_the_middle_of_a_part(sent: int) -> None:
    """The rest of the part does not come before it is asked to end."""
    stop, ended = ReaderStop(), threading.Event()
    cut = len(MULTIPART) + sent
    answer = MULTIPART + part(small_jpeg(), "Content-Length: 100000")

    def in_two(client: socket.socket) -> None:
        client.sendall(answer[:cut])
        stop.set()
        client.sendall(answer[cut:])
        ended.wait(60.0)

    with answering(in_two) as url:
        try:
            read_mjpeg(url, lambda data, stamp: pytest.fail("no whole image came"), stop)
        finally:
            ended.set()


@pytest.mark.parametrize(
    ("case", "begins", "drop"),
    [
        ("an image with a length", part(b"", "Content-Length: 30000000"), b"x"),
        ("an image without one", part(b""), b"x"),
        ("headers", b"--x\r\n", b"A: b\r\n"),
        ("a line", b"--x\r\n", b"x"),
    ],
)
def test_a_part_that_never_ends_is_given_up(
    case: str, begins: bytes, drop: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A byte now and then is no silence. By a clock that the drops move."""
    clock_s, ended = [0.0], threading.Event()
    monkeypatch.setattr(mjpeg.time, "monotonic", lambda: clock_s[0])

    def drip(client: socket.socket) -> None:
        client.sendall(MULTIPART + part(small_jpeg()) + begins)
        while not ended.wait(0.01):
            clock_s[0] += 0.5
            client.sendall(drop)

    with answering(drip) as url:
        try:
            with pytest.raises(DeviceLost, match="an image takes longer than 3 s"):
                read_mjpeg(url, lambda data, stamp: None, ReaderStop())
        finally:
            ended.set()


def test_a_reader_that_waits_for_its_camera_ends_when_what_it_holds_is_closed() -> None:
    stop, ended = ReaderStop(), threading.Event()

    def close(client: socket.socket) -> None:
        assert stop.device is not None
        stop.device.close()
        ended.wait(60.0)

    with answering(close) as url:
        try:
            with pytest.raises(DeviceLost, match="unexpected response"):
                read_mjpeg(url, lambda data, stamp: None, stop)
        finally:
            ended.set()


def test_an_address_that_gives_something_else_is_left_to_the_video_reader() -> None:
    _, error = received(b"HTTP/1.0 200 OK\r\nContent-Type: video/mp4\r\n\r\n....")
    assert isinstance(error, NotMjpeg)


@pytest.mark.parametrize("url", ["http://127.0.0.1:9/", "http://127.0.0.1:99999/", "http://[::1/"])
def test_an_address_where_nobody_is_is_said(url: str) -> None:
    with pytest.raises(DeviceLost, match="http"):
        read_mjpeg(url, lambda data, stamp: None, ReaderStop())


@pytest.mark.parametrize("stamp", ["1e300", "-5", "nan", "inf", "1e13"])
def test_a_stamp_that_is_no_time_is_left_out(stamp: str) -> None:
    jpeg = small_jpeg()
    found, _ = received(MULTIPART + part(jpeg, f"Content-Length: {len(jpeg)}", f"X-Timestamp: {stamp}"))
    assert found == [(jpeg, None)]
