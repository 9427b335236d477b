"""Cameras that send video: RTSP and HTTP through PyAV (which can give up on a camera that hangs), local ones through
OpenCV (which supports the devices of every system), and a video file played as a camera would."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import av
import cv2
import numpy as np

from pipeline.formats.video_file import open_video, within_budget
from pipeline.sources.live.devices.device_reader import NAME_S, SILENCE_S, DeviceLost, ReaderStop
from pipeline.types.camera_shot import Shot

_OPEN_S = 2.0
WORST_DEVICE_S = 10.0
"""How long OpenCV waits for an image of a local camera."""
WORST_OPEN_S = NAME_S + 2 * _OPEN_S + SILENCE_S
"""How long it takes to give up on an address: FFmpeg's limit holds for opening and for finding its streams, each."""
_RTSP = {"rtsp_transport": "tcp", "fflags": "nobuffer", "flags": "low_delay"}
_SLOWEST_HZ, _FASTEST_HZ, _USUAL_HZ = 1.0, 240.0, 30.0

ReceiveShot = Callable[[Shot], None]


def read_stream(url: str, receive: ReceiveShot, stop: ReaderStop) -> None:
    """RTSP or video over HTTP. DeviceLost if it cannot be opened, ends or falls silent."""
    options = _RTSP if url.startswith("rtsp") else {"fflags": "nobuffer"}
    try:
        with av.open(url, timeout=(_OPEN_S, SILENCE_S), options=options) as container:
            within_budget(container)
            for shot, _ in _shots(container, stop):
                receive(shot)
            if stop:
                return
    except (av.FFmpegError, OSError, ValueError) as error:
        raise DeviceLost(f"{url}: {_reason(error)}") from None
    raise DeviceLost(f"{url}: the camera closed the connection")


def play_file(path: Path, receive: ReceiveShot, stop: ReaderStop) -> None:
    """A video at its own rate, in a loop. DeviceLost if it is not a video."""
    while not stop:
        begun, shown = time.monotonic(), 0
        try:
            with open_video(path) as container:
                for shot, at_s in _shots(container, stop):
                    stop.wait(max(0.0, begun + at_s - time.monotonic()))
                    if stop:
                        return
                    receive(shot)
                    shown += 1
        except (av.FFmpegError, OSError, ValueError) as error:
            raise DeviceLost(f"{path}: {_reason(error)}") from None
        if not shown:
            raise DeviceLost(f"{path}: no images")


def read_device(device: int | str, receive: ReceiveShot, stop: ReaderStop) -> None:
    """A local camera, by number or path. DeviceLost if there is none or it was unplugged."""
    number = device_number(device)
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)  # errors are reported once, by this program
    capture = cv2.VideoCapture(number)
    try:
        if not capture.isOpened():
            raise DeviceLost(f"camera {device}: not connected, or in use by another program")
        capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        while not stop:
            ok, pixels = capture.read()
            if not ok or pixels is None:
                raise DeviceLost(f"camera {device}: delivers no images")
            receive(Shot(pixels=np.ascontiguousarray(pixels, dtype=np.uint8)))
    finally:
        capture.release()


def device_number(device: int | str) -> int:
    """A camera's number for OpenCV. A path such as /dev/v4l/by-id/… is a link to the camera's current number, which
    changes when it is plugged in again. DeviceLost if it leads to no camera."""
    if isinstance(device, int):
        return device
    found = re.fullmatch(r"/dev/video(\d+)", os.path.realpath(device))
    if found is None:
        raise DeviceLost(f"camera {device}: not connected, or not a camera")
    return int(found[1])


def _shots(container: av.container.InputContainer, stop: ReaderStop) -> Iterator[tuple[Shot, float]]:
    """Each image with its time in the video, seconds, until ``stop``, which is checked between packets: a damaged video
    may have no images. JPEGs are passed on unchanged."""
    if not container.streams.video:
        raise ValueError("no video stream")
    stream = container.streams.video[0]
    rate = float(stream.average_rate or stream.base_rate or _USUAL_HZ)
    rate = rate if _SLOWEST_HZ <= rate <= _FASTEST_HZ else _USUAL_HZ
    keeps_jpeg = stream.codec_context.name == "mjpeg"
    for count, packet in enumerate(container.demux(stream)):
        if stop:
            return
        if keeps_jpeg and packet.size:
            yield Shot(encoded=bytes(packet)), _time_s(packet, count / rate)
        elif not keeps_jpeg:
            for frame in packet.decode():
                yield Shot(frame=frame), frame.time if frame.time is not None else count / rate


def _time_s(packet: av.Packet, otherwise: float) -> float:
    if packet.pts is None or packet.time_base is None:
        return otherwise
    return float(packet.pts * packet.time_base)


def _reason(error: Exception) -> str:
    if isinstance(error, av.error.ExitError):  # FFmpeg's word for a time limit
        return "no response"
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__
