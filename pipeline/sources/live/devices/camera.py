"""A camera of any kind as an input: its images, with the best known time at which each was taken."""

from __future__ import annotations

from pipeline.sources.live.clock import FollowedClock, HostClock
from pipeline.sources.live.config import CameraConfig
from pipeline.sources.live.devices import mjpeg, video_stream
from pipeline.sources.live.devices.device_reader import ReadDevice, Reader, ReaderStop
from pipeline.sources.live.devices.sensor_input import Deliver
from pipeline.sources.live.health import StreamStats
from pipeline.types.camera_shot import Shot, is_whole_jpeg

_ARRIVAL = "sends no timestamps: images are stamped on arrival"


class CameraInput:
    """If a camera timestamps its images, its clock is tracked; otherwise an image's time is its arrival time."""

    def __init__(self, config: CameraConfig, clock: HostClock, deliver: Deliver[Shot]) -> None:
        self.stats = StreamStats("camera")
        self._clock, self._deliver = clock, deliver
        self._offset_ns = round(config.time_offset_ms * 1e6)
        self._own = FollowedClock()
        worst_s = video_stream.WORST_DEVICE_S if config.device is not None else video_stream.WORST_OPEN_S
        self.readers: tuple[Reader, ...] = (Reader("camera", self._read(config), self._say, worst_s),)

    def clock_offset_ms(self) -> float | None:
        return self._own.offset_ms

    def _read(self, config: CameraConfig) -> ReadDevice:
        if config.url is not None:
            return _HttpOrVideo(config.url, self.receive, self._shot)
        if config.file is not None:
            path = config.file
            return lambda stop: video_stream.play_file(path, self._shot, stop)
        device = config.device
        assert device is not None
        return lambda stop: video_stream.read_device(device, self._shot, stop)

    def receive(self, data: bytes, stamp_us: int | None) -> None:
        """Take a JPEG and its timestamp, µs since 1970, if it has one. A truncated JPEG is counted as lost."""
        if not is_whole_jpeg(data):
            self.stats.lost += 1
            return
        now_ns = self._clock.now_ns()
        if stamp_us is None:
            self._give(Shot(encoded=data), now_ns, now_ns, _ARRIVAL)
        else:
            self._give(Shot(encoded=data), self._own.to_host_ns(stamp_us * 1000, now_ns), now_ns, "")

    def _shot(self, shot: Shot) -> None:
        now_ns = self._clock.now_ns()
        self._give(shot, now_ns, now_ns, _ARRIVAL)

    def _give(self, shot: Shot, t_ns: int, now_ns: int, note: str) -> None:
        self.stats.note = note
        self.stats.arrived(now_ns, t_ns + self._offset_ns)
        self._deliver(t_ns + self._offset_ns, shot, now_ns)

    def _say(self, text: str) -> None:
        self.stats.note = text


class _HttpOrVideo:
    """An address: MJPEG if it serves that, else video. The detected type is used again on reconnect."""

    def __init__(self, url: str, jpeg: mjpeg.ReceiveImage, shot: video_stream.ReceiveShot) -> None:
        self._url, self._jpeg, self._shot = url, jpeg, shot
        self._is_video = not url.startswith("http")

    def __call__(self, stop: ReaderStop) -> None:
        if not self._is_video:
            try:
                return mjpeg.read_mjpeg(self._url, self._jpeg, stop)
            except mjpeg.NotMjpeg:
                self._is_video = True
        video_stream.read_stream(self._url, self._shot, stop)
