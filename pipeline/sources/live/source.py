"""``live:<config.yaml>``: the sensors of one car as a source of ticks, of which only the newest is kept.

Reader threads pass their data to the synchroniser; consumers take the newest tick from it. There is no queue between
them, so the shown data is never older than the sensors and the pipeline make it.
"""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import Any, TypeVar

from pipeline.ego_motion.from_gnss import MotionFromGnss
from pipeline.params import SyncParams
from pipeline.sources.live.clock import HostClock
from pipeline.sources.live.config import LiveConfig, load
from pipeline.sources.live.devices.camera import CameraInput
from pipeline.sources.live.devices.can import CanInput
from pipeline.sources.live.devices.gnss import GnssInput
from pipeline.sources.live.devices.lidar import LidarInput
from pipeline.sources.live.devices.sensor_input import Input
from pipeline.sources.live.health import StreamStats, not_delivering
from pipeline.sources.live.sync import SensorBuffer, Stamped, Synchroniser, Together
from pipeline.sources.rig import calibration_for
from pipeline.types import F64, U8, CameraImage, EgoState, Frame, GnssFix, StreamHealth, Sweep
from pipeline.types.camera_shot import Shot
from pipeline.types.source import Opening, Tap

T = TypeVar("T")

_SWEEPS_HZ, _IMAGES_HZ = 10.0, 30.0
"""Usual rates of LiDARs and cameras, of which one triggers the ticks."""
_LOOK_AGAIN_S = 0.005
"""Polling interval while a tick waits for its image, or for the LiDAR to count as silent."""


def open_sensors(uri: str, rest: str, how: Opening) -> LiveSensors:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if the config file cannot be used."""
    return LiveSensors(uri, load(rest))


class LiveSensors:
    """See ``pipeline.types.source.LiveSource``. SourceError if a DBC file does not contain what the config names.

    A frame's index counts all ticks, including those not taken in time, so a gap in it is a drop.
    """

    def __init__(self, uri: str, config: LiveConfig, clock: HostClock | None = None) -> None:
        self.uri, self.title = uri, config.title
        self.rate_hz = _SWEEPS_HZ if config.lidar is not None else _IMAGES_HZ
        self.dropped = 0
        self._index = -1
        self._clock = clock or HostClock()
        self._sync: Synchroniser[Shot] = Synchroniser()
        self._came = threading.Condition()
        self._is_open = False
        self._tap: Tap | None = None
        self._decoded: tuple[Shot, U8 | None] | None = None
        """The last decoded image: an upcoming tick and the tick share it."""
        self._wire(config)
        self.notes = _about(config)

    def _wire(self, config: LiveConfig) -> None:
        """Create an input for each configured sensor, each delivering to its own stream."""
        self.inputs: dict[str, Input] = {}
        sync = self._sync
        self._streams: dict[str, SensorBuffer[Any]] = {
            "lidar": sync.sweeps,
            "camera": sync.images,
            "gnss": sync.fixes,
            "ego": sync.egos,
        }
        self._ego_stats: StreamStats | None = None
        self._motion = MotionFromGnss()
        calibration = config.camera.calibration if config.camera is not None else None
        self.camera = calibration.calibration() if calibration is not None else None
        lidar = None
        if config.lidar is not None:
            self.inputs["lidar"] = lidar = LidarInput(config.lidar, self._clock, self._take_sweep)
        if config.camera is not None:
            self.inputs["camera"] = CameraInput(config.camera, self._clock, self._take_shot)
        if config.gnss is not None:
            utc = {} if lidar is None else {"utc_to_host_ns": lidar.utc_to_host_ns}
            self.inputs["gnss"] = GnssInput(config.gnss, self._clock, self._take_fix, **utc)
        if config.ego is not None and config.ego.can is not None:
            offset_ms, can = config.ego.time_offset_ms, config.ego.can
            self.inputs["ego"] = CanInput(can, offset_ms, self._clock, self._take_ego)
        elif config.ego is not None:
            self._ego_stats = StreamStats("ego")
            self._ego_stats.note = "its speed comes from gnss, which delivers none yet"
            self._ego_offset_ns = round(config.ego.time_offset_ms * 1e6)

    def start(self) -> None:
        """Open the devices; a device that is not available yet is retried."""
        self._is_open = True
        for each in self.inputs.values():
            for reader in each.readers:
                reader.start()

    def close(self) -> None:
        """Release the devices. Safe to call twice."""
        if not self._is_open:
            return
        self._is_open = False
        readers = [reader for each in self.inputs.values() for reader in each.readers]
        for reader in readers:
            reader.end()
        for reader in readers:
            reader.join()

    @property
    def lidar_mount(self) -> tuple[F64, int] | None:
        """T_ego_lidar (4, 4) and the offset in ns that is added to the LiDAR's timestamps; None without a LiDAR."""
        lidar = self.inputs.get("lidar")
        return (lidar.T_ego_lidar, lidar.offset_ns) if isinstance(lidar, LidarInput) else None

    def tap(self, tap: Tap | None) -> None:
        """Pass messages to ``tap`` from now on; None stops that. Duplicates and messages with impossible times are not
        passed on."""
        self._tap = tap
        lidar = self.inputs.get("lidar")
        if isinstance(lidar, LidarInput):
            lidar.on_packet = tap.packet if tap is not None else None

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        """The newest tick not returned yet; None if none arrives in time."""
        self._look()
        together = self._wait(timeout_s, params or SyncParams())
        return self._frame(together) if together is not None else None

    def upcoming(self, params: SyncParams | None = None) -> Frame | None:
        """The next tick without its sweep; None while its image is not known."""
        with self._came:
            known = self._sync.upcoming(self._clock.now_ns(), params or SyncParams())
        image = self._image(known.image, []) if known is not None else None
        if known is None or image is None:
            return None
        index = self._index + 1
        camera = calibration_for(self.camera, image, [])
        return Frame(index, f"{index:06d}", known.t_ns, image=image, camera=camera, ego=known.ego)

    def now_ns(self) -> int:
        """Current time on the timeline of the ticks."""
        return self._clock.now_ns()

    def health(self) -> tuple[StreamHealth, ...]:
        """Current health of each configured sensor."""
        self._look()
        now_ns = self._clock.now_ns()
        stats = [each.stats for each in self.inputs.values()]
        if self._ego_stats is not None:
            stats.append(self._ego_stats)
        with self._came:
            return tuple(each.health(now_ns, self._streams[each.sensor].implausible) for each in stats)

    def _look(self) -> None:
        """Restarts readers that hang."""
        for each in self.inputs.values():
            for reader in each.readers:
                reader.look(time.monotonic())
            each.stats.was_restarted(sum(reader.hung for reader in each.readers))

    def _wait(self, timeout_s: float, params: SyncParams) -> Together[Shot] | None:
        end_s = time.monotonic() + timeout_s
        with self._came:
            while True:
                together = self._sync.tick(self._clock.now_ns(), params)
                left_s = end_s - time.monotonic()
                if together is not None or left_s <= 0.0:
                    return together
                self._came.wait(min(left_s, _LOOK_AGAIN_S))

    def _add(self, stream: SensorBuffer[T], t_ns: int, value: T, arrived_ns: int) -> bool:
        """Add a message to its stream; false if it was refused."""
        with self._came:
            was_taken = stream.add(t_ns, value, arrived_ns)
            self._came.notify_all()
            return was_taken

    def _take_sweep(self, t_ns: int, sweep: Sweep, arrived_ns: int) -> None:
        tap, sweep = self._tap, replace(sweep, t_ns=t_ns)
        if self._add(self._sync.sweeps, t_ns, sweep, arrived_ns) and tap is not None:
            tap.sweep(sweep, arrived_ns)

    def _take_shot(self, t_ns: int, shot: Shot, arrived_ns: int) -> None:
        tap = self._tap
        if self._add(self._sync.images, t_ns, shot, arrived_ns) and tap is not None:
            tap.image(shot, t_ns, arrived_ns)

    def _take_ego(self, t_ns: int, ego: EgoState, arrived_ns: int) -> None:
        tap = self._tap
        if self._add(self._sync.egos, t_ns, ego, arrived_ns) and tap is not None:
            tap.ego(ego, arrived_ns)

    def _take_fix(self, t_ns: int, fix: GnssFix, arrived_ns: int) -> None:
        tap = self._tap
        if self._add(self._sync.fixes, t_ns, fix, arrived_ns) and tap is not None:
            tap.fix(fix, arrived_ns)
        if self._ego_stats is not None:
            ego = self._motion.push(fix)
            ego = replace(ego, t_ns=ego.t_ns + self._ego_offset_ns)
            self._ego_stats.note = ""
            self._ego_stats.arrived(arrived_ns, ego.t_ns)
            self._take_ego(ego.t_ns, ego, arrived_ns)

    def _frame(self, together: Together[Shot]) -> Frame:
        taken_ns = self._clock.now_ns()
        self.dropped += together.replaced
        self._index += 1 + together.replaced
        notes = list(together.notes)
        image = self._image(together.image, notes) if together.image is not None else None
        decoded_ns = self._clock.now_ns()
        streams = self.health()
        missing = not_delivering(streams)
        notes += [missing] if missing else []
        notes += [text for each in self.inputs.values() if (text := each.stats.warning())]
        return Frame(
            self._index,
            f"{self._index:06d}",
            together.t_ns,
            sweep=together.sweep.value if together.sweep is not None else None,
            image=image,
            camera=calibration_for(self.camera, image, notes),
            ego=together.ego,
            notes=tuple(notes),
            gnss=together.gnss,
            streams=streams,
            timing_ms={
                "arrival": (together.arrived_ns - together.t_ns) / 1e6,
                "waiting": (taken_ns - together.arrived_ns) / 1e6,
                "picture": (decoded_ns - taken_ns) / 1e6,
            },
        )

    def _image(self, taken: Stamped[Shot], notes: list[str]) -> CameraImage | None:
        shot = taken.value
        if self._decoded is None or self._decoded[0] is not shot:
            self._decoded = shot, shot.bgr()
        bgr = self._decoded[1]
        if bgr is None:
            notes.append("the image is damaged")
            return None
        return CameraImage(taken.t_ns, bgr, shot.encoded)


def _about(config: LiveConfig) -> tuple[str, ...]:
    """What a user should know about this set of sensors."""
    notes = []
    if config.lidar is None:
        notes.append("no LiDAR: frames follow the camera")
    if config.camera is None:
        notes.append("no camera: the pipeline runs on LiDAR alone")
    elif config.camera.calibration is None:
        notes.append("the camera has no calibration: LiDAR and camera are not fused")
    if config.ego is None:
        notes.append("no ego speed: neither gnss nor can provides it")
    return tuple(notes)
