"""A recording in one file or, split by size and time, in several; each is a complete session."""

from __future__ import annotations

import copy
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from pipeline.params import Params
from pipeline.recording.mcap.disk_time import DiskTime
from pipeline.recording.mcap.output import Compression
from pipeline.recording.neighbours import EarlierFile
from pipeline.recording.session.log_time import SessionClock
from pipeline.recording.session.provenance import About
from pipeline.recording.session.velodyne_scan import RawLidar
from pipeline.recording.session.writer import SessionWriter
from pipeline.types import EgoState, Frame, GnssFix, Result, Sweep
from pipeline.types.camera_shot import Shot
from pipeline.types.source import TruthObject


@dataclass(frozen=True)
class FileRotation:
    """When a recording continues in a new file."""

    max_bytes: float | None = None
    """Of one file; None for no limit."""
    max_s: float | None = None
    """Of recorded time; None for no limit."""


NEVER = FileRotation()
_PACKETS_CARRIED = 6
"""Number of batches, each of about one sweep."""


class Segments:
    """Writes to ``path`` and, after rotation, to ``<stem>_001.mcap`` and so on beside it. Not thread-safe. The files
    name each other: see ``neighbours``.

    frames, seconds: over all files, seconds by log time. disk: time spent waiting for it. BadInput if a file exists;
    OSError if a file cannot be written any more: after that nothing can be written, and earlier data is complete.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        rotation: FileRotation = NEVER,
        compression: Compression = "zstd",
        raw_lidar: RawLidar | None = None,
    ) -> None:
        self._raw_lidar = raw_lidar
        self._recent_packets: deque[list[tuple[int, bytes]]] = deque(maxlen=_PACKETS_CARRIED)
        self._about, self._rotation, self._compression = about, rotation, compression
        self._clock = SessionClock()
        self._earlier_frames, self._earlier_bytes = 0, 0
        self._earlier_s = 0.0
        self.disk = DiskTime()
        self.files = [path]
        self._writer = self._open(path)

    @property
    def frames(self) -> int:
        """Number of frames passed to all files so far."""
        return self._earlier_frames + self._writer.frames

    @property
    def kept_frames(self) -> int:
        """See ``SessionWriter.kept_frames``."""
        return self._earlier_frames + self._writer.kept_frames

    @property
    def bytes_written(self) -> int:
        """Size of all files so far."""
        return self._earlier_bytes + self._writer.bytes_written

    @property
    def is_pending(self) -> bool:
        """See ``Output.is_pending``."""
        return self._writer.is_pending

    @property
    def seconds(self) -> float:
        """Time span of the frames in all files."""
        return self._earlier_s + self._writer.span_s

    def write(
        self,
        frame: Frame,
        result: Result | None = None,
        params: Params | None = None,
        *,
        received_ns: int | None = None,
        truth: tuple[TruthObject, ...] | None = None,
    ) -> None:
        """See ``SessionWriter.write``."""
        if self._is_full():
            self._rotate()
        self._writer.write(frame, result, params, received_ns=received_ns, truth=truth)

    def write_packets(self, packets: list[tuple[int, bytes]]) -> None:
        """See ``SessionWriter.write_packets``."""
        self._recent_packets.append(packets)
        self._writer.write_packets(packets)

    def write_sweep(self, sweep: Sweep, arrived_ns: int) -> None:
        """See ``SessionWriter.write_sweep``."""
        self._writer.write_sweep(sweep, arrived_ns)

    def write_image(self, shot: Shot, t_ns: int, arrived_ns: int) -> None:
        """See ``SessionWriter.write_image``."""
        self._writer.write_image(shot, t_ns, arrived_ns)

    def write_ego(self, ego: EgoState, arrived_ns: int) -> None:
        """See ``SessionWriter.write_ego``."""
        self._writer.write_ego(ego, arrived_ns)

    def write_fix(self, fix: GnssFix, arrived_ns: int) -> None:
        """See ``SessionWriter.write_fix``."""
        self._writer.write_fix(fix, arrived_ns)

    def write_mark(self, text: str) -> None:
        """See ``SessionWriter.write_mark``."""
        self._writer.write_mark(text)

    def write_note(self, text: str) -> None:
        """See ``SessionWriter.write_note``."""
        self._writer.write_note(text)

    def flush(self, *, to_disk: bool = False) -> None:
        """See ``Output.flush``."""
        self._writer.flush(to_disk=to_disk)

    def close(self) -> None:
        """Safe to call twice."""
        self._writer.close()

    def continued(self) -> Segments:
        """The same recording from the next file on, for another thread, while the one that uses this hangs. Frames that
        are in no complete chunk here do not count."""
        fresh = copy.copy(self)
        fresh._clock = copy.copy(self._clock)
        fresh._recent_packets = self._recent_packets.copy()
        fresh.files = self.files.copy()
        fresh._earlier_frames = self.kept_frames
        fresh._earlier_bytes, fresh._earlier_s = self.bytes_written, self.seconds
        fresh._begin_file(EarlierFile(self.files[-1].name, ""))  # where this file will end is not known yet
        return fresh

    def abandon(self) -> None:
        """End the last file after its last complete chunk, for the thread that was replaced."""
        self._writer.abandon()

    def _is_full(self) -> bool:
        limit = self._rotation
        too_large = limit.max_bytes is not None and self._writer.bytes_written >= limit.max_bytes
        return self._writer.frames > 0 and (
            too_large or (limit.max_s is not None and self._writer.span_s >= limit.max_s)
        )

    def _rotate(self) -> None:
        follows = self._writer.close(continues_in=self._next_path().name)
        earlier = self.frames, self.bytes_written, self.seconds
        self._begin_file(follows)
        self._earlier_frames, self._earlier_bytes, self._earlier_s = earlier

    def _next_path(self) -> Path:
        first = self.files[0]
        return first.with_name(f"{first.stem}_{len(self.files):03d}{first.suffix}")

    def _begin_file(self, follows: EarlierFile) -> None:
        path = self._next_path()
        self._writer = self._open(path, follows)
        self.files.append(path)
        for packets in self._recent_packets:  # packets of the sweep in the first frame of the new file
            self._writer.write_packets(packets)

    def _open(self, path: Path, follows: EarlierFile | None = None) -> SessionWriter:
        return SessionWriter(
            path,
            self._about,
            compression=self._compression,
            clock=self._clock,
            raw_lidar=self._raw_lidar,
            disk=self.disk,
            follows=follows,
        )
