"""The list of a session's frames at the end of its file: the position of each, and the small parts of its tick. A pass
over all frames of a drive reads only this list and decompresses no chunk."""

from __future__ import annotations

import gzip
import io
import zlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.mcap.output import Output
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.session.frame_record import FrameRecord, frame_record_from, frame_record_message

I64 = npt.NDArray[np.int64]
_LONGEST_LINE = 1 << 20
_NO_TICK = b"null"


class FrameList:
    """List of the frames of a session that is being written. A tick without labels and recorded detections takes some
    100 bytes, compressed."""

    def __init__(self) -> None:
        self._times: list[tuple[int, int]] = []
        self._packed = io.BytesIO()
        self._lines = gzip.GzipFile(fileobj=self._packed, mode="wb", mtime=0)

    def __len__(self) -> int:
        return len(self._times)

    @property
    def span_s(self) -> float:
        """Log time from the first frame to the last."""
        return (self._times[-1][0] - self._times[0][0]) / 1e9 if self._times else 0.0

    def add(self, log_time_ns: int, t_ns: int, tick: FrameRecord | None) -> None:
        """tick: None if it cannot be read."""
        self._times.append((log_time_ns, t_ns))
        line = frame_record_message(replace(tick, truth=None, given=None)) if tick is not None else _NO_TICK
        self._lines.write(line + b"\n")

    def attach(self, output: Output) -> None:
        """Append the list to the session; nothing can be added afterwards."""
        self._lines.close()
        times = np.array(self._times, dtype="<i8").tobytes()
        output.add_attachment(topics.INDEX, "application/octet-stream", times)
        output.add_attachment(topics.TICKS, "application/gzip", self._packed.getvalue())


def listed_times(file: McapFile) -> tuple[I64, I64] | None:
    """(N,) log times and (N,) header times of all frames, None without a list."""
    data = file.attachment(topics.INDEX)
    if data is None or len(data) % 16:
        return None
    pairs = np.frombuffer(data, dtype="<i8").reshape(-1, 2)
    return pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64)


def listed_records(file: McapFile) -> Iterator[FrameRecord | None]:
    """Each frame's tick without ``truth`` and ``given``, in order; None for one that could not be read. Ends early if
    the list is damaged, and is empty without a list."""
    lines = gzip.GzipFile(fileobj=io.BytesIO(file.attachment(topics.TICKS) or b""))
    while True:
        try:
            line = lines.readline(_LONGEST_LINE)
            tick = None if line.rstrip() in (_NO_TICK, b"") else frame_record_from(line)
        except (OSError, EOFError, zlib.error, Damaged):
            return
        if not line:
            return
        yield tick
