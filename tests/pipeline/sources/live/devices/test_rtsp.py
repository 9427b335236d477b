"""A camera that speaks RTSP: found, shown, lost and found again."""

from __future__ import annotations

import os
import resource
import socket
import threading
import time

import numpy as np
import pytest

from pipeline.sources.live.devices.device_reader import DeviceLost, ReaderStop
from pipeline.sources.live.devices.video_stream import read_stream
from pipeline.sources.live.source import LiveSensors
from tests.app.waiting import wait_until
from tests.pipeline.sources.live.rig import frames_until, free_port, loopback_config, opened, tcp_device
from tests.pipeline.sources.live.rtsp_camera import BAR_PX, GREY, HEIGHT, WIDTH, Behaviour, Codec, rtsp_camera


@pytest.mark.parametrize("codec", ["h264", "mjpeg"])
def test_a_camera_that_speaks_rtsp(codec: Codec) -> None:
    """Plugged in late, unplugged, and plugged in again."""
    port = free_port(socket.SOCK_STREAM)
    camera_at = {"url": f"rtsp://127.0.0.1:{port}/front"}
    source = LiveSensors("live:rtsp", loopback_config(lidar=None, gnss=None, ego=None, camera=camera_at))
    source.start()
    try:
        for _ in range(2):
            with rtsp_camera(port, codec):
                for _ in range(20):
                    image = frames_until(source, lambda frame: frame.image is not None).image
                    assert image is not None
                    assert image.bgr.shape == (HEIGHT, WIDTH, 3)
                    assert np.median(image.bgr[:, : BAR_PX - 10]) > 220, "the white bar"
                    assert np.median(image.bgr[:, BAR_PX + 10 :]) == pytest.approx(GREY, abs=12)
                    assert (image.encoded is not None) == (codec == "mjpeg"), "a JPEG stays as it came"
                (health,) = source.health()
                assert (health.sensor, health.note != "") == ("camera", True), "its images have no times of their own"
    finally:
        source.close()


@pytest.mark.parametrize("fault", ["stalls", "noise", "damaged", "without end", "closes", "another size"])
def test_a_camera_that_fails_in_any_way_is_back_when_it_is_well_again(
    fault: Behaviour, sensors: list[LiveSensors]
) -> None:
    """Whatever it sends meanwhile: the reader neither hangs nor holds on to it, and its size may change."""
    port = free_port(socket.SOCK_STREAM)
    config = loopback_config(lidar=None, gnss=None, ego=None, camera={"url": f"rtsp://127.0.0.1:{port}/front"})
    with rtsp_camera(port) as camera:
        source = opened(config, sensors)
        frame = frames_until(source, lambda frame: frame.image is not None)
        assert frame.image is not None
        assert frame.image.bgr.shape == (HEIGHT, WIDTH, 3)
        assert np.median(frame.image.bgr[:, : BAR_PX - 10]) > 220
        camera.does = fault
        if fault == "another size":
            frames_until(source, lambda frame: frame.image is not None and frame.image.bgr.shape[0] == HEIGHT // 2)
        else:
            assert wait_until(lambda: source.next(0.05) is None and source.health()[0].state == "silent")
            assert wait_until(lambda: source.next(0.05) is None and camera.clients > 1), "it is opened anew"
        camera.does = "well"
        frames_until(source, lambda frame: frame.image is not None and frame.image.bgr.shape[0] == HEIGHT)
        (health,) = source.health()
        assert "hung" not in health.note
        assert "Errno" not in health.note


_OK = b"RTSP/1.0 200 OK\r\nCSeq: 1\r\n"
FLOODS = {
    "noise": (b"", os.urandom(65_536)),
    "packets that nobody asked for": (_OK + b"Public: DESCRIBE\r\n\r\n", b"$\x00\xff\xff" + bytes(65_535)),
    "a description of gigabytes": (_OK + b"Content-Length: 2147483647\r\n\r\n", b"a=x\r\n" * 10_000),
}


@pytest.mark.parametrize("flood", FLOODS)
def test_a_camera_that_floods_instead_of_answering_is_given_up_and_takes_no_memory(flood: str) -> None:
    """At the speed of the loopback. The connection is abandoned within a bounded time, however long the flood lasts."""
    first, rest = FLOODS[flood]
    ended = threading.Event()

    def pour(client: socket.socket) -> None:
        client.recv(4096)
        client.sendall(first)
        while not ended.is_set():
            client.sendall(rest)

    with tcp_device(pour) as port:
        before, began_s = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.monotonic()
        try:
            with pytest.raises(DeviceLost):
                read_stream(f"rtsp://127.0.0.1:{port}/", lambda shot: None, ReaderStop())
        finally:
            ended.set()
        assert time.monotonic() - began_s < 15.0
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 50_000, "kilobytes"
