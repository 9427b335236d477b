"""Writes frames and results to one session file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.params import Params
from pipeline.recording import topics
from pipeline.recording.mcap.disk_time import DiskTime
from pipeline.recording.mcap.output import Compression, Output
from pipeline.recording.mcap.written_index import WrittenIndex
from pipeline.recording.neighbours import CONTINUES, FOLLOWS, EarlierFile
from pipeline.recording.session.detections import given_of
from pipeline.recording.session.frame_list import FrameList
from pipeline.recording.session.frame_record import (
    CameraRecord,
    FrameRecord,
    ImageRef,
    ScanRef,
    SweepRef,
    ego_message,
    frame_record_message,
    health_message,
    route_message,
)
from pipeline.recording.session.log_time import SessionClock
from pipeline.recording.session.messages import (
    calibration_message,
    image_message,
    jpeg_message,
    jpeg_of,
    location_message,
    log_message,
    points_message,
    transform_messages,
)
from pipeline.recording.session.provenance import About
from pipeline.recording.session.range_scan import range_scan_message
from pipeline.recording.session.scene_update import objects_message
from pipeline.recording.session.velodyne_scan import RawLidar, scan_message
from pipeline.types import CameraCalibration, CameraImage, EgoState, Frame, GnssFix, RangeScan, Result, Route, Sweep
from pipeline.types.camera_shot import Shot
from pipeline.types.result_json import encoded, to_json
from pipeline.types.source import TruthObject

_KEPT, _SWEEPS_KEPT = 256, 16
"""Number of received messages that a frame may refer to: one second of all sensor messages; fewer clouds, which are
large."""


class SessionWriter:
    """Writes one file. Not thread-safe; use ``Recorder`` for that. OSError if the file cannot be written any more.

    raw_lidar: clouds are not stored, but their packets are, by ``write_packets``, and are decoded on reading. Data that
    does not change from frame to frame (calibration, route, parameters, an image shown twice) is written once.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        *,
        compression: Compression = "zstd",
        clock: SessionClock | None = None,
        raw_lidar: RawLidar | None = None,
        disk: DiskTime | None = None,
        follows: EarlierFile | None = None,
    ) -> None:
        """follows: the file before this one in the same recording."""
        self._raw_lidar = raw_lidar
        self._output = Output(path, compression, disk=disk)
        self._output.add_metadata(topics.METADATA, about.to_metadata())
        if follows is not None:
            self._output.add_metadata(FOLLOWS, follows.to_metadata())
        self._clock = clock or SessionClock()
        self._frames = FrameList()
        self._kept_frames = 0
        self._sha256 = ""
        self._header_ns = 0
        self._tick: FrameRecord | None = None
        self._image: CameraImage | None = None
        self._camera: CameraCalibration | None = None
        self._route: Route | None = None
        self._params: Params | None = None
        self._ego: EgoState | None = None
        self._gnss: GnssFix | None = None
        self._came, self._sweeps = WrittenIndex(_KEPT), WrittenIndex(_SWEEPS_KEPT)

    @property
    def path(self) -> Path:
        return self._output.path

    @property
    def bytes_written(self) -> int:
        return self._output.bytes_written

    @property
    def frames(self) -> int:
        return len(self._frames)

    @property
    def kept_frames(self) -> int:
        """Number of ``frames`` in complete chunks, finally all: these remain if the file cannot be written any more."""
        return self._kept_frames

    @property
    def is_pending(self) -> bool:
        """See ``Output.is_pending``."""
        return self._output.is_pending

    @property
    def span_s(self) -> float:
        """Log time from the first frame to the last."""
        return self._frames.span_s

    def write(
        self,
        frame: Frame,
        result: Result | dict[str, Any] | None = None,
        params: Params | None = None,
        *,
        received_ns: int | None = None,
        truth: tuple[TruthObject, ...] | None = None,
    ) -> None:
        """Append a frame, with its result if there is one. A result may already be JSON (docs/reference/results.md).

        received_ns: when the frame was made, by the recorder's clock; None for one from a recording.
        """
        at_ns = self._clock.log_time(frame.t_ns, received_ns)
        self._header_ns = frame.t_ns
        tick = FrameRecord(
            name=frame.name,
            t_ns=frame.t_ns,
            notes=frame.notes,
            sweep=self._put_sweep(frame.sweep, at_ns) if self._raw_lidar is None else None,
            packets=self._raw_lidar.reference(frame.sweep) if self._raw_lidar is not None and frame.sweep else None,
            picture=self._put_image(frame.image, at_ns),
            camera=self._put_camera(frame.camera, at_ns),
            ego=frame.ego,
            gnss=frame.gnss,
            streams=frame.streams,
            timing_ms=dict(frame.timing_ms),
            route_at_ns=self._put_route(frame.route, at_ns),
            params_at_ns=self._put_params(params, at_ns),
            truth=truth,
            given=given_of(frame),
            scans={sensor: self._put_scan(sensor, scan, at_ns) for sensor, scan in frame.scans.items()},
        )
        self._put_small(frame, at_ns)
        if result is not None:
            self._put_result(result, at_ns)
        self._add(topics.FRAMES, at_ns, frame_record_message(tick))
        self._frames.add(at_ns, frame.t_ns, tick)
        self._tick = tick

    def write_packets(self, packets: list[tuple[int, bytes]]) -> None:
        """Raw LiDAR packets, (receive time in ns, payload) each, oldest first, as one ``VelodyneScan``."""
        received_ns = packets[-1][0]
        at_ns = self._clock.log_time(received_ns, received_ns)
        self._add(topics.PACKETS, at_ns, scan_message(packets), packets[0][0])

    def write_sweep(self, sweep: Sweep, arrived_ns: int) -> None:
        """Write a sweep on arrival, whether or not a frame contains it. A frame with exactly these points then refers
        to it, unless the frame came first and has written it."""
        if self._sweeps.log_time(sweep.points) is None:
            self._add_sweep(sweep, self._clock.log_time(sweep.t_ns, arrived_ns))

    def write_image(self, shot: Shot, t_ns: int, arrived_ns: int) -> None:
        """Write an image on arrival, whether or not a tick contains it: the JPEG unchanged, or for a camera without
        JPEGs one of high quality. A frame with exactly this JPEG then refers to it."""
        data = shot.encoded if shot.encoded is not None else jpeg_of(shot)
        if data is None:
            return
        at_ns = self._clock.log_time(t_ns, arrived_ns)
        self._add(topics.IMAGE, at_ns, jpeg_message(data, t_ns), t_ns)
        self._came.add(data, at_ns)

    def write_ego(self, ego: EgoState, arrived_ns: int) -> None:
        """Write own motion on arrival."""
        self._add(topics.EGO, self._clock.log_time(ego.t_ns, arrived_ns), ego_message(ego), ego.t_ns)
        self._came.add(ego, 0)

    def write_fix(self, fix: GnssFix, arrived_ns: int) -> None:
        """Write a fix on arrival."""
        self._add(topics.GNSS, self._clock.log_time(fix.t_ns, arrived_ns), location_message(fix), fix.t_ns)
        self._came.add(fix, 0)

    def write_mark(self, text: str) -> None:
        """Write a user's mark after the last frame."""
        self._add(topics.MARKS, self._clock.now(), log_message(topics.MARKS, text, self._header_ns))

    def write_note(self, text: str) -> None:
        """Write a note for users who open the session."""
        self._add(topics.NOTES, self._clock.now(), log_message(topics.NOTES, text, self._header_ns, warning=True))

    def write_labels(self, data: bytes) -> None:
        """Write a label file for the whole session; the last one written counts."""
        self._add(topics.LABELS, self._clock.now(), data)

    def write_drawn(self, topic: str, data: bytes) -> None:
        """Write the labels of the last frame in the form shown by viewers."""
        self._add(topic, self._clock.now(), data)

    def flush(self, *, to_disk: bool = False) -> None:
        """See ``Output.flush``."""
        self._output.flush(to_disk=to_disk)
        self._kept_frames = len(self._frames)

    def close(self, continues_in: str | None = None) -> EarlierFile:
        """Write the list of frames and the summary. Safe to call twice. continues_in: name of the next file of the same
        recording. Returns what that file says about this one."""
        if self._output.is_open:
            self._output.flush()
            self._sha256 = self._output.last_sha256
            self._frames.attach(self._output)
            if continues_in is not None:
                self._output.add_metadata(CONTINUES, {"file": continues_in})
            self._output.close()
            self._kept_frames = len(self._frames)
        return EarlierFile(self.path.name, self._sha256)

    def abandon(self) -> None:
        """See ``Output.abandon``."""
        self._output.abandon()

    def discard(self) -> None:
        """Remove the file, because its content could not be produced."""
        self._output.discard()

    def _add(self, topic: str, at_ns: int, data: bytes, t_ns: int | None = None) -> None:
        before = self._output.bytes_written
        self._output.add(topics.channel(topic), at_ns, self._header_ns if t_ns is None else t_ns, data)
        if self._output.bytes_written > before:
            is_kept = topic == topics.FRAMES and not self._output.is_pending
            self._kept_frames = len(self._frames) + is_kept

    def _put_sweep(self, sweep: Sweep | None, at_ns: int) -> SweepRef | None:
        if sweep is None:
            return None
        came_at_ns = self._sweeps.log_time(sweep.points)
        if came_at_ns is None:
            self._add_sweep(sweep, at_ns)
        return SweepRef(at_ns if came_at_ns is None else came_at_ns, sweep.t_ns, sweep.channels, sweep.origin)

    def _add_sweep(self, sweep: Sweep, at_ns: int) -> None:
        self._add(topics.POINTS, at_ns, points_message(sweep), sweep.t_ns)
        self._sweeps.add(sweep.points, at_ns)

    def _put_scan(self, sensor: str, scan: RangeScan, at_ns: int) -> ScanRef:
        self._add(topics.scan_topic(sensor), at_ns, range_scan_message(sensor, scan), scan.t_ns)
        return ScanRef(at_ns, scan.t_ns)

    def _put_image(self, image: CameraImage | None, at_ns: int) -> ImageRef | None:
        if image is None:
            return None
        if image is self._image and self._tick is not None and self._tick.picture is not None:
            return self._tick.picture
        self._image = image
        came_at_ns = self._came.log_time(image.encoded)
        if came_at_ns is not None:
            return ImageRef(came_at_ns, image.t_ns)
        self._add(topics.IMAGE, at_ns, image_message(image, self._header_ns), image.t_ns)
        return ImageRef(at_ns, image.t_ns)

    def _put_camera(self, camera: CameraCalibration | None, at_ns: int) -> CameraRecord | None:
        before = self._tick.camera if self._tick is not None else None
        if camera is not None and camera is self._camera and before is not None:
            return before
        self._camera = camera
        record = CameraRecord.of(camera, at_ns) if camera is not None else None
        if record is not None and before is not None and replace(record, at_ns=before.at_ns) == before:
            return before
        if record != before or self._tick is None:
            for data in transform_messages(camera, self._header_ns):
                self._add(topics.TF, at_ns, data)
        if camera is not None:
            self._add(topics.CALIBRATION, at_ns, calibration_message(camera, self._header_ns))
        return record

    def _put_route(self, route: Route | None, at_ns: int) -> int | None:
        if route is None:
            return None
        if route is self._route and self._tick is not None and self._tick.route_at_ns is not None:
            return self._tick.route_at_ns
        self._route = route
        self._add(topics.ROUTE, at_ns, route_message(route))
        return at_ns

    def _put_params(self, params: Params | None, at_ns: int) -> int | None:
        if params is None:
            return None
        if (
            self._tick is not None
            and self._tick.params_at_ns is not None
            and (params is self._params or params == self._params)
        ):
            return self._tick.params_at_ns
        self._params = params
        self._add(topics.PARAMS, at_ns, params.model_dump_json().encode())
        return at_ns

    def _put_small(self, frame: Frame, at_ns: int) -> None:
        """Write parts of the tick again for viewers, on separate topics."""
        if frame.ego is not None and frame.ego is not self._ego and self._came.log_time(frame.ego) is None:
            self._add(topics.EGO, at_ns, ego_message(frame.ego), frame.ego.t_ns)
        if frame.gnss is not None and frame.gnss is not self._gnss and self._came.log_time(frame.gnss) is None:
            self._add(topics.GNSS, at_ns, location_message(frame.gnss), frame.gnss.t_ns)
        if frame.streams:
            self._add(topics.HEALTH, at_ns, health_message(frame.streams))
        for note in frame.notes:
            self._add(topics.NOTES, at_ns, log_message(topics.NOTES, note, frame.t_ns, warning=True))
        self._ego, self._gnss = frame.ego, frame.gnss

    def _put_result(self, result: Result | dict[str, Any], at_ns: int) -> None:
        content = to_json(result) if isinstance(result, Result) else result
        self._add(topics.RESULTS, at_ns, encoded(content))
        self._add(topics.OBJECTS, at_ns, objects_message(content, self._header_ns))
