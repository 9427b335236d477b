"""A video file with random access to its images by time; no image is kept in memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from threading import Lock

import av
import numpy as np

from pipeline.common.files.image_decoding import MOST_PIXELS, check_pixels
from pipeline.common.files.user_file_errors import reason_of
from pipeline.common.files.user_files import check_regular, open_regular, overload_told_apart
from pipeline.common.nearest_in_time import Times
from pipeline.common.progress import Progress, silent
from pipeline.types import U8
from pipeline.types.source import SourceError

_FORMATS = "mov,mp4,m4a,3gp,3g2,mj2,avi,matroska,webm,mjpeg,mjpeg_2000,mpegts,mpeg,mpegvideo,h264,hevc,ogg,flv,asf"
_NS = 1_000_000_000
_DECODE_ON_NS = 2 * _NS
"""An image this little later is reached sooner by decoding on than by seeking."""
_TELL_EVERY = 256
"""Images between two words of progress."""
_PLACES = 2
"""What is shown, and what is computed beside it."""
_BEFORE_NS = (0, 2 * _NS, 12 * _NS)
"""Formats without an index, such as MPEG-TS, lead to any image, and only a key image can be decoded alone. From the
first place whose images do not begin too late, the wanted one is reached."""
_FROM_START_NS = 60 * _NS
"""An image within this time is also reached from the beginning of the file."""
PATIENCE_S = 10.0
"""Maximum time until the next image's data are found: a disk reads half a gigabyte in it, an image has a few MB. FFmpeg
searches damaged files and gigabytes of zeros byte by byte, and nothing else interrupts it."""


def open_video(path: Path) -> av.container.InputContainer:
    """A video file, ready to be decoded within the budget of an image. OSError for what is no regular file. What a
    playlist in it names is not opened: FFmpeg would fetch it from any server. Reading on raises av.ExitError if nothing
    is found within ``PATIENCE_S``."""
    check_regular(path)
    options = {"protocol_whitelist": "file", "format_whitelist": _FORMATS}
    container = av.open(str(path.resolve()), options=options, timeout=PATIENCE_S)
    within_budget(container)
    return container


def within_budget(container: av.container.InputContainer) -> None:
    """Have FFmpeg refuse images that are larger than any camera's, also where their size changes on the way. ValueError
    for images that no decoder here knows."""
    for stream in container.streams.video:
        if stream.codec_context is None:
            raise ValueError("its images are of an unknown kind")
        stream.codec_context.options = {"max_pixels": str(MOST_PIXELS)}


class VideoFile:
    """times_ns: (N,) int64, ascending, of every image since the first. Times come from the container; where it has
    none, the images are evenly spaced at its rate. Any thread: two that read on at different places do not make each
    other seek."""

    def __init__(self, path: Path, progress: Progress = silent) -> None:
        self.path = path
        try:
            with open_video(path) as container:
                stamps, tick_ns = _stamps(container, progress)
        except (av.InvalidDataError, av.ExitError):
            raise SourceError(f"{path.name}: not a readable video: {_about_unreadable(path)}") from None
        except (av.FFmpegError, OSError, ValueError) as error:
            raise SourceError(f"{path.name}: not a readable video: {reason_of(error)}") from None
        if not len(stamps):
            raise SourceError(f"{path.name}: no images")
        first = int(stamps[0])
        self.times_ns: Times = np.rint((stamps - first) * tick_ns).astype(np.int64)
        self._lock = Lock()
        self._places = [_Place(path, first, tick_ns) for _ in range(_PLACES)]  # the one used last stands last

    def image(self, index: int) -> U8:
        """(H, W, 3) uint8 blue green red of one of ``times_ns``, upright where a telephone was held on its side.
        SourceError when it cannot be decoded."""
        wanted_ns = int(self.times_ns[index])
        with self._lock:
            place = next((each for each in self._places if each.is_near(wanted_ns)), self._places[0])
            self._places.remove(place)
            self._places.append(place)
        try:
            with overload_told_apart():
                return place.image(wanted_ns)
        except (av.FFmpegError, OSError, ValueError, StopIteration) as error:
            reason = f"not found within {PATIENCE_S:g} s" if isinstance(error, av.ExitError) else reason_of(error)
            raise SourceError(f"{self.path.name}: image {index} cannot be decoded: {reason}") from None


def _about_unreadable(path: Path) -> str:
    """Why FFmpeg finds no video in a file, and what to do about it."""
    with suppress(OSError), open_regular(path) as file:
        begin = file.read(8)
        if not begin:
            return "an empty file"
        if begin[4:] == b"ftyp":
            return (
                "cut off before its index, which cameras write last; a repair program such as untrunc makes a new one"
            )
    return "cut off, or something else"


class _Place:
    """Where one reader is in the file. seeks: how often it had to go somewhere else."""

    def __init__(self, path: Path, first_stamp: int, tick_ns: float) -> None:
        self.seeks = 0
        self._path, self._first_stamp, self._tick_ns = path, first_stamp, tick_ns
        self._lock = Lock()
        self._frames: Iterator[av.VideoFrame] | None = None
        self._container: av.container.InputContainer | None = None
        self._at_ns = 0

    def is_near(self, wanted_ns: int) -> bool:
        """Whether decoding on leads there soon."""
        return self._frames is not None and self._at_ns < wanted_ns <= self._at_ns + _DECODE_ON_NS

    def image(self, wanted_ns: int) -> U8:
        """The image of a time. Whatever the library raises; the next one is then read from the file anew."""
        with self._lock:
            try:
                return self._decode(wanted_ns)
            except BaseException:
                self._close()
                raise

    def _decode(self, wanted_ns: int) -> U8:
        if self.is_near(wanted_ns):
            frame, _ = self._read_on(wanted_ns)
        else:
            frame = self._from_before(wanted_ns)
        if frame is None:
            raise ValueError("the video ends before it")
        check_pixels(frame.width, frame.height)
        upright = np.rot90(frame.to_ndarray(format="bgr24"), round(frame.rotation / 90))
        return np.ascontiguousarray(upright, dtype=np.uint8)

    def _from_before(self, wanted_ns: int) -> av.VideoFrame | None:
        """The image of a time or, if it is damaged, the next one; None if there is none."""
        frame, begins_too_late = None, True
        for before_ns in _BEFORE_NS:
            self._seek(wanted_ns - before_ns)
            frame, begins_too_late = self._read_on(wanted_ns)
            if not begins_too_late or before_ns > wanted_ns:
                break
        if begins_too_late and wanted_ns <= _FROM_START_NS:
            self._close()
            self._open()
            frame, _ = self._read_on(wanted_ns)
        return frame

    def _read_on(self, wanted_ns: int) -> tuple[av.VideoFrame | None, bool]:
        """The next image that is not before a time, None if there is none; and whether it is the first one here, and
        later than that time."""
        assert self._frames is not None
        half_tick_ns, is_first = self._tick_ns / 2, True
        for frame in self._frames:
            if frame.pts is None:
                continue
            self._at_ns = round((frame.pts - self._first_stamp) * self._tick_ns)
            if self._at_ns >= wanted_ns - half_tick_ns:
                return frame, is_first and self._at_ns > wanted_ns + half_tick_ns
            is_first = False
        return None, is_first

    def _seek(self, wanted_ns: int) -> None:
        self.seeks += 1
        container = self._container if self._container is not None else self._open()
        stream = container.streams.video[0]
        container.seek(self._first_stamp + int(max(wanted_ns, 0) / self._tick_ns), stream=stream)
        self._frames = container.decode(stream)

    def _open(self) -> av.container.InputContainer:
        self._container = open_video(self._path)
        self._frames = self._container.decode(self._container.streams.video[0])
        return self._container

    def _close(self) -> None:
        if self._container is not None:
            self._container.close()
        self._container = self._frames = None


def _stamps(container: av.container.InputContainer, progress: Progress) -> tuple[np.ndarray, float]:
    """Presentation stamps of every image, ascending, and nanoseconds a tick; nothing is decoded. Of a file in which no
    further image is found in time, those before. progress: of the file's bytes."""
    if not container.streams.video:
        raise ValueError("no video stream")
    stream = container.streams.video[0]
    if stream.time_base is None:
        raise ValueError("its images have no times")
    stamps = []
    with suppress(av.ExitError):
        for count, packet in enumerate(container.demux(stream)):
            if packet.pts is not None:
                stamps.append(packet.pts)
            if count % _TELL_EVERY == 0 and packet.pos is not None:
                progress(packet.pos, container.size)
    return np.unique(np.array(stamps, dtype=np.int64)), float(stream.time_base) * _NS
