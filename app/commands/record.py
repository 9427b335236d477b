"""`cipv record`: run the pipeline on a recording or live sensors, and write inputs and results to a session."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Annotated, cast

import tyro

from app.commands.support.arguments import option
from app.commands.support.options import PipelineOptions, SourceOptions
from app.commands.support.progress_bars import frames_progress
from app.commands.support.sensor_wait import Waiting
from app.core.session_folder import SESSIONS
from app.core.stop_signals import asked_to_stop
from app.engine.session_recording import new_session
from pipeline.common.errors import BadInput
from pipeline.common.watchdog import Watchdog
from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.recording.recorder import Recorder
from pipeline.recording.save import about
from pipeline.recording.segments import FileRotation, Segments
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.run import run, run_live
from pipeline.sources import is_live
from pipeline.types import Frame, Result
from pipeline.types.source import LiveSource, Source, is_live_source


@dataclass(frozen=True)
class Record:
    """Run the pipeline and record its inputs and results to a session, until the end or Ctrl-C.

    Example: cipv record live:car.yaml --out sessions --rotate-minutes 10
    """

    source: SourceOptions
    out: Annotated[Path, tyro.conf.arg(metavar="DIR|FILE.mcap")] = SESSIONS
    """A new file, or a folder in which the file is named by title and time"""
    pipeline: PipelineOptions = field(default_factory=PipelineOptions)
    seconds: Annotated[float | None, option("S")] = None
    """Stop after S seconds of the drive"""
    packets: bool = False
    """Live sensors: record raw LiDAR packets instead of point clouds; they are decoded when the session is opened"""
    rotate_mb: Annotated[float | None, option("MB")] = None
    """Start a new file when this size is reached"""
    rotate_minutes: Annotated[float | None, option("MIN")] = None
    """Start a new file after MIN minutes of the drive"""

    def __call__(self) -> int:
        params = self.pipeline.parameters()
        if self.packets and not is_live(self.source.source):
            raise BadInput("--packets works with live sensors only; recordings contain no packets to record")
        with asked_to_stop() as asked:
            source = self.source.open_any()
            if is_live_source(source):
                return self._live(source, params, asked)
            return self._offline(cast("Source", source), params, asked)

    def _offline(self, source: Source, params: Params, asked: Event) -> int:
        """Record from a recording, which waits for the disk, so no frame is dropped."""
        detectors = self.pipeline.open_detectors(source)
        segments = Segments(new_session(self.out, source.title), about(source, detectors), self._rotation)
        _say_where(segments.files[0])
        with closing(segments), frames_progress() as bar:
            task = bar.add_task(source.title, total=len(source))
            for index, (frame, result) in enumerate(self._until_enough(run(source, params, detectors), asked)):
                segments.write(frame, result, params, truth=source.truth(index))
                bar.advance(task)
        _say(segments.files, segments.frames, segments.bytes_written)
        return 0

    def _live(self, source: LiveSource, params: Params, asked: Event) -> int:
        """Record from live sensors, which do not wait: what the disk or the machine is too slow for is
        dropped and counted."""
        detectors, waiting, watchdog = self.pipeline.open_detectors(source), Waiting(source), Watchdog()
        recorder = self._recorder(source, detectors, watchdog)
        watchdog.start()

        def on_silence() -> None:
            _end_if(asked)
            waiting()

        source.tap(recorder)
        _say_where(recorder.state.file)
        try:
            with frames_progress() as bar:
                task = bar.add_task(source.title, total=None)
                ran = run_live(source, params, detectors, on_silence=on_silence)
                for frame, result in self._until_enough(ran, asked):
                    recorder.put(frame, result, params, received_ns=source.now_ns())
                    if recorder.state.error is not None:
                        break
                    bar.advance(task)
        finally:
            source.tap(None)
            state = recorder.stop()
            watchdog.stop()
        if state.frames == 0 and state.error is None:
            state.file.unlink(missing_ok=True)
            print("cipv: no data received; nothing saved", file=sys.stderr)
            return 1
        _say(list(state.files), state.frames, state.bytes)
        if source.dropped:
            print(
                f"cipv: the pipeline was too slow for {source.dropped} ticks; their sensor data was recorded",
                file=sys.stderr,
            )
        if state.dropped:
            print(f"cipv: {state.dropped} frames or samples dropped because {state.dropped_because}", file=sys.stderr)
        if state.error is not None:
            print(f"cipv: {state.error}", file=sys.stderr)
        return 0 if state.error is None else 1

    def _recorder(self, source: LiveSource, detectors: Detectors, watchdog: Watchdog) -> Recorder:
        """A recorder of point clouds, or with --packets of raw packets."""
        path, mount = new_session(self.out, source.title), source.lidar_mount
        if not self.packets:
            return Recorder(path, about(source, detectors), self._rotation, watchdog=watchdog)
        if mount is None:
            raise BadInput(f"--packets: {source.uri} has no LiDAR")
        raw = RawLidar(*mount)
        return Recorder(path, about(source, detectors), self._rotation, raw_lidar=raw, watchdog=watchdog)

    @property
    def _rotation(self) -> FileRotation:
        max_bytes = None if self.rotate_mb is None else self.rotate_mb * 1e6
        max_s = None if self.rotate_minutes is None else self.rotate_minutes * 60.0
        return FileRotation(max_bytes, max_s)

    def _until_enough(self, ran: Iterator[tuple[Frame, Result]], asked: Event) -> Iterator[tuple[Frame, Result]]:
        """The frames until ``seconds`` have passed or a stop is requested; in both cases the file is finished
        properly."""
        first_ns = None
        with suppress(_Ended):
            for frame, result in ran:
                first_ns = frame.t_ns if first_ns is None else first_ns
                if self.seconds is not None and frame.t_ns - first_ns > self.seconds * 1e9:
                    return
                yield frame, result
                _end_if(asked)


class _Ended(Exception):
    """Raised if a stop was requested."""


def _end_if(asked: Event) -> None:
    if asked.is_set():
        raise _Ended


def _say_where(file: Path) -> None:
    print(f"cipv: recording to {file}; press Ctrl-C to stop", file=sys.stderr)


def _say(files: list[Path], frames: int, count: int) -> None:
    names = str(files[0]) if len(files) == 1 else f"{files[0]} … {files[-1].name}"
    print(f"cipv: {names}: {frames} frames, {count / 1e6:.1f} MB", file=sys.stderr)
