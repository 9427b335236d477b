"""Exports a clip as a video: the camera image with the overlay, as H.264 in an MP4 that every player and browser
supports."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np

from app.clips.clip import Clip, clip_frames
from app.clips.overlay import draw_frame
from pipeline.common.progress import Progress
from pipeline.params import Params
from pipeline.types import F64, U8, Frame, Result

_TICKS_PER_S = 1000
_QUALITY = "20"
"""x264's constant rate factor: 18 is visually lossless, 23 is the default."""


def write(clip: Clip, path: Path, progress: Progress) -> None:
    """Write the clip as an MP4 file."""
    times_s = clip.recording.setup.timeline_s
    write_film(clip_frames(clip, progress), clip.params, times_s, clip.rate_hz, path)


def write_film(
    run: Iterable[tuple[Frame, Result]], params: Params, timeline_s: F64, rate_hz: float, path: Path
) -> None:
    """Write frames as an MP4 file. Each frame is shown from its own time on the timeline to that of the next one, as on
    the page.

    timeline_s: (N,) of the whole drive. A frame whose size differs from the first is fitted into it.
    """
    with av.open(str(path), "w", format="mp4", options={"movflags": "faststart"}) as film:
        stream = film.add_stream("libx264", rate=Fraction(rate_hz).limit_denominator(1000))
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": _QUALITY, "preset": "veryfast"}
        stream.codec_context.time_base = Fraction(1, _TICKS_PER_S)
        size, start_s = (0, 0), 0.0
        for frame, result in run:
            drawn = draw_frame(frame, result, params)
            if size == (0, 0):
                size, start_s = (drawn.shape[1], drawn.shape[0]), float(timeline_s[frame.index])
                stream.width, stream.height = size
            image = av.VideoFrame.from_ndarray(_fitted(drawn, size), format="bgr24")
            image.pts = round((float(timeline_s[frame.index]) - start_s) * _TICKS_PER_S)
            image.time_base = Fraction(1, _TICKS_PER_S)
            film.mux(stream.encode(image))
        film.mux(stream.encode(None))


def _fitted(drawn: U8, size: tuple[int, int]) -> U8:
    if (drawn.shape[1], drawn.shape[0]) == size:
        return np.ascontiguousarray(drawn)
    return np.asarray(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA), np.uint8)
