"""A session as a ``Source``: reading any frame takes a few chunks, whatever the length of the file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain, repeat
from typing import Any, TypeVar

import numpy as np

from pipeline.common.files.remote_files import is_remote
from pipeline.common.files.user_file_errors import given_path
from pipeline.common.progress import Progress, silent
from pipeline.params import Params, ParamsError, with_changes
from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap.reader import McapFile, NotMcap
from pipeline.recording.session.frame_list import I64, listed_records, listed_times
from pipeline.recording.session.frame_record import (
    CameraRecord,
    FrameRecord,
    ImageRef,
    ScanRef,
    frame_record_from,
    route_from,
)
from pipeline.recording.session.messages import image_from, log_text, sweep_from
from pipeline.recording.session.provenance import VERSION, About
from pipeline.recording.session.range_scan import range_scan_from
from pipeline.recording.session.velodyne_scan import sweep_of_packets
from pipeline.types import CameraCalibration, CameraImage, Frame, GnssFix, RangeScan, Route, Sweep
from pipeline.types.source import Mark, Opening, SourceError, TruthObject

_T = TypeVar("_T")


def open_recording(uri: str, rest: str, how: Opening) -> SessionSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return SessionSource(uri, rest, how.progress)


class SessionSource:
    """An MCAP session. SourceError if the file cannot be read, is not a session, or contains no frames.

    origin: the URI of the original source. is_simulated: whether that was a simulated drive.
    """

    def __init__(self, uri: str, path: str, progress: Progress = silent) -> None:
        try:
            self.file = McapFile(path if is_remote(path) else given_path(path, SourceError))
        except (NotMcap, OSError, RuntimeError, ValueError) as error:
            raise SourceError(str(error)) from None
        try:
            about = self._about(path)
            self._log_ns, self._t_ns = self._frames(progress)
            if not len(self._t_ns):
                cut = ": it was cut off before the first" if self.file.directory.is_cut else ""
                raise SourceError(f"{path}: the session holds no frames{cut}")
        except SourceError:
            self.file.close()
            raise
        self.uri, self.origin, self.title, self.rate_hz = uri, about.origin, about.title, about.rate_hz
        self.is_simulated = about.is_of_simulator
        self.notes = (*about.notes, *self._problems(path))
        self._image: tuple[ImageRef, CameraImage] | None = None
        self._camera: tuple[CameraRecord, CameraCalibration] | None = None
        self._route: tuple[int, Route] | None = None

    def __len__(self) -> int:
        return len(self._t_ns)

    def t_ns(self, index: int) -> int:
        return int(self._t_ns[self._checked(index)])

    def log_time_ns(self, index: int) -> int:
        """When the frame was received, by the recorder's clock; also used to find its messages."""
        return int(self._log_ns[self._checked(index)])

    def frame(self, index: int) -> Frame:
        notes: list[str] = []
        return self._frame_of(index, self._read_record(index, notes), notes, is_whole=True)

    def outlines(self) -> Iterator[Frame]:
        for index, tick in self._listed():
            notes: list[str] = []
            yield self._frame_of(index, tick or self._read_record(index, notes), notes, is_whole=False)

    def sweep(self, index: int) -> Sweep | None:
        tick = self._read_record(index, [])
        return _or_note(lambda: self._sweep(tick, self.log_time_ns(index)), []) if tick is not None else None

    def _frame_of(self, index: int, tick: FrameRecord | None, notes: list[str], is_whole: bool) -> Frame:
        if tick is None:
            return Frame(index, f"{index:06d}", self.t_ns(index), notes=tuple(notes))
        return Frame(
            index,
            tick.name,
            tick.t_ns,
            _or_note(lambda: self._sweep(tick, self.log_time_ns(index)), notes) if is_whole else None,
            _or_note(lambda: self._read_image(tick.picture), notes) if is_whole else None,
            _or_note(lambda: self._read_camera(tick.camera), notes),
            tick.ego,
            gnss=tick.gnss,
            route=_or_note(lambda: self._read_route(tick.route_at_ns), notes) if is_whole else None,
            streams=tick.streams,
            timing_ms=tick.timing_ms,
            scans=self._read_scans(tick, notes) if is_whole else {},
            **_given(tick, notes),
            notes=(*tick.notes, *notes),  # evaluated last, because reading the parts adds notes
        )

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        tick = self._read_record(index, [])
        return tick.truth if tick is not None else None

    def params(self, index: int) -> Params | None:
        """Parameters of the frame when it was recorded; None if a session contains only inputs."""
        tick = self._read_record(index, [])
        if tick is None or tick.params_at_ns is None:
            return None
        try:
            return _params_from(self.file.message(topics.PARAMS, tick.params_at_ns).data)
        except (Damaged, ValueError, AttributeError, RecursionError, ParamsError):
            return None

    def result(self, index: int) -> dict[str, Any] | None:
        """The result of the frame when it was recorded, as JSON (docs/reference/results.md); None without one."""
        try:
            found = json.loads(self.file.message(topics.RESULTS, self.log_time_ns(index)).data)
        except (Damaged, ValueError, RecursionError):
            return None
        return found if isinstance(found, dict) else None

    def marks(self) -> tuple[Mark, ...]:
        """Every mark made during the recording."""
        found = []
        for stored in self.file.messages((topics.MARKS,)):
            try:
                found.append(Mark(stored.publish_time_ns, log_text(topics.MARKS, stored.data)))
            except Damaged:
                continue
        return tuple(found)

    def fixes(self) -> tuple[GnssFix, ...]:
        """Position of the car, frame by frame; points and images are not unpacked."""
        ticks = (tick or self._read_record(index, []) for index, tick in self._listed())
        return tuple(tick.gnss for tick in ticks if tick is not None and tick.gnss is not None)

    def labels(self) -> bytes | None:
        """The newest label file in it, None if there is none."""
        newest = None
        for stored in self.file.messages((topics.LABELS,)):
            newest = stored.data
        return newest

    def close(self) -> None:
        self.file.close()

    # ------------------------------------------------------------ opening

    def _about(self, path: str) -> About:
        metadata = self.file.metadata(topics.METADATA)
        if metadata is None:
            kind = self.file.directory.profile or "unknown"
            hint = f"; try rosbag:{path}" if kind.startswith("ros") else ""
            raise SourceError(f"{path}: an MCAP file, but not a session of CIPV Studio (its profile is {kind!r}){hint}")
        try:
            about = About.from_metadata(metadata)
        except ValueError as error:
            raise SourceError(f"{path}: the session cannot be read: {error}") from None
        if about.version > VERSION:
            raise SourceError(f"{path}: a session of version {about.version}; this program reads up to {VERSION}")
        return about

    def _frames(self, progress: Progress) -> tuple[I64, I64]:
        """Log time and header time of every frame: from the list at the file's end, else from the frames."""
        listed = listed_times(self.file)
        if listed is not None:
            return listed
        stamps = []
        for stored in self.file.messages((topics.FRAMES,), progress=progress):
            try:
                stamps.append((stored.log_time_ns, frame_record_from(stored.data).t_ns))
            except Damaged:
                continue
        pairs = np.array(stamps, dtype=np.int64).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def _problems(self, path: str) -> list[str]:
        notes = []
        if self.file.directory.problem is not None:
            notes.append(f"{self.file.directory.problem}; `cipv recover {path}` repairs it")
        if self.file.damaged:
            notes.append(f"{len(self.file.damaged)} parts of the file are damaged")
        return notes

    # ------------------------------------------------------------ one frame

    def _checked(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return index

    def _listed(self) -> Iterator[tuple[int, FrameRecord | None]]:
        """Every frame with its tick from the list at the file's end, None if it is not listed."""
        listed = chain(listed_records(self.file), repeat(None))
        for index, (t_ns, tick) in enumerate(zip(self._t_ns, listed, strict=False)):
            yield index, tick if tick is not None and tick.t_ns == t_ns else None

    def _read_record(self, index: int, notes: list[str]) -> FrameRecord | None:
        at_ns = self.log_time_ns(index)
        return _or_note(lambda: frame_record_from(self.file.message(topics.FRAMES, at_ns).data), notes)

    def _sweep(self, tick: FrameRecord, at_ns: int) -> Sweep | None:
        if tick.packets is not None:
            return sweep_of_packets(tick.packets, at_ns, self.file)
        if tick.sweep is None:
            return None
        ref = tick.sweep
        return sweep_from(self.file.message(topics.POINTS, ref.at_ns).data, ref.t_ns, ref.channels, ref.origin)

    def _read_scans(self, tick: FrameRecord, notes: list[str]) -> dict[str, RangeScan]:
        """Those that can be read, in the order in which they were written."""

        def scan(sensor: str, ref: ScanRef) -> RangeScan:
            return range_scan_from(sensor, self.file.message(topics.scan_topic(sensor), ref.at_ns).data, ref.t_ns)

        read = {sensor: _or_note(partial(scan, sensor, ref), notes) for sensor, ref in tick.scans.items()}
        return {sensor: each for sensor, each in read.items() if each is not None}

    def _read_image(self, ref: ImageRef | None) -> CameraImage | None:
        """An image shared by several ticks is returned as the same object."""
        if ref is None:
            return None
        held = self._image
        if held is None or held[0] != ref:
            held = self._image = ref, image_from(self.file.message(topics.IMAGE, ref.at_ns).data, ref.t_ns)
        return held[1]

    def _read_camera(self, record: CameraRecord | None) -> CameraCalibration | None:
        """A calibration is valid until it changes and is shared by all ticks."""
        if record is None:
            return None
        held = self._camera
        if held is None or held[0] != record:
            held = self._camera = record, record.calibration()
        return held[1]

    def _read_route(self, at_ns: int | None) -> Route | None:
        if at_ns is None:
            return None
        held = self._route
        if held is None or held[0] != at_ns:
            held = self._route = at_ns, route_from(self.file.message(topics.ROUTE, at_ns).data)
        return held[1]


def _params_from(data: bytes) -> Params:
    """A parameter that did not exist when it was recorded gets its default."""
    sections = json.loads(data).items()
    return with_changes(
        Params(), {f"{name}.{key}": value for name, values in sections for key, value in values.items()}
    )


def _given(tick: FrameRecord, notes: list[str]) -> dict[str, Any]:
    """The fields of a frame with recorded detections."""
    if tick.given is None:
        return {}
    boxes, lanes = tick.given.boxes, tick.given.lanes
    return {
        "raw_boxes": _or_note(boxes.raw, notes) if boxes is not None else None,
        "raw_lanes": _or_note(lanes.raw, notes) if lanes is not None else None,
        "detections_given": True,
    }


def _or_note(read: Callable[[], _T], notes: list[str]) -> _T | None:
    """The result of ``read``; None, with a note, if it is damaged."""
    try:
        return read()
    except Damaged as damage:
        notes.append(str(damage))
        return None
