"""Cameras by device, and video from files and addresses."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import av
import numpy as np
import pytest

from pipeline.formats import video_file
from pipeline.sources.live.config import LiveConfig
from pipeline.sources.live.devices.device_reader import DeviceLost, ReaderStop
from pipeline.sources.live.devices.video_stream import device_number, play_file, read_stream
from pipeline.sources.live.source import LiveSensors
from pipeline.types import Frame
from pipeline.types.camera_shot import Shot
from tests.pipeline.sources.live.rig import frames_until, opened


def test_a_number_is_itself() -> None:
    assert device_number(3) == 3


def test_a_link_leads_to_the_number_that_the_camera_has_now(tmp_path: Path) -> None:
    link = tmp_path / "usb-046d_C920-video-index0"
    for number in (62, 7):
        link.unlink(missing_ok=True)
        link.symlink_to(f"/dev/video{number}")
        assert device_number(str(link)) == number


@pytest.mark.parametrize("device", ["/dev/v4l/by-id/not-there", "/dev/null", "/dev/video"])
def test_what_leads_to_no_camera_is_said(device: str) -> None:
    with pytest.raises(DeviceLost, match=f"camera {device}: not connected"):
        device_number(device)


def test_a_video_file_is_a_camera(sensors: list[LiveSensors], tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    film(path, 5)
    config = LiveConfig.model_validate({"camera": {"file": str(path)}})
    source = opened(config, sensors)
    seen: list[Frame] = []
    frames_until(source, lambda frame: len(seen) > 7, seen)
    shades = {round(float(each.image.bgr.mean()) / 60) for each in seen if each.image is not None}
    assert len(shades) >= 3, "it plays, and begins again at its end"
    assert "images are stamped on arrival" in seen[-1].streams[0].note


def test_what_is_not_a_video_is_said_and_tried_again(sensors: list[LiveSensors], tmp_path: Path) -> None:
    path = tmp_path / "drive.mp4"
    path.write_bytes(b"no video")
    source = opened(LiveConfig.model_validate({"camera": {"file": str(path)}}), sensors)
    assert source.next(0.6) is None
    assert "drive.mp4" in source.health()[0].note
    assert source.health()[0].state == "absent"


def test_video_over_http_is_a_camera_too(sensors: list[LiveSensors], tmp_path: Path) -> None:
    film(tmp_path / "drive.mp4", 12)
    handler = partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    handler.log_message = lambda *_: None  # type: ignore[attr-defined]
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            url = f"http://127.0.0.1:{server.server_address[1]}/drive.mp4"
            source = opened(LiveConfig.model_validate({"camera": {"url": url}}), sensors)
            frame = frames_until(source, lambda frame: frame.image is not None)
            source.close()
        finally:
            server.shutdown()
            thread.join()
    assert frame.image is not None
    assert frame.image.bgr.shape == (48, 64, 3)


@pytest.mark.parametrize("read", [read_stream, play_file])
def test_images_larger_than_a_cameras_are_refused_in_streams_too(
    read: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "drive.mp4"
    film(path, 3)
    shots: list[Shot] = []

    def first() -> None:
        stop = ReaderStop()
        read(path if read is play_file else str(path), lambda shot: (shots.append(shot), stop.set()), stop)

    first()
    assert len(shots) == 1
    monkeypatch.setattr(video_file, "MOST_PIXELS", 64 * 48 - 1)
    with pytest.raises(DeviceLost):
        first()
    assert len(shots) == 1


def test_a_camera_that_is_not_plugged_in_is_said(sensors: list[LiveSensors]) -> None:
    source = opened(LiveConfig.model_validate({"camera": {"device": 63}}), sensors)
    for _ in range(600):
        source.next(0.05)
        if source.health()[0].note:
            break
    assert "camera 63: not connected" in source.health()[0].note


def film(path: Path, count: int) -> None:
    """A video of grey images, each brighter than the last."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for shade in np.linspace(0, 240, count).astype(np.uint8):
            frame = av.VideoFrame.from_ndarray(np.full((48, 64, 3), shade, np.uint8), format="bgr24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
