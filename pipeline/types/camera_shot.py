"""An image as the camera sent it, decoded only on demand: with a 60 Hz camera, five of six images are never decoded."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.common.files.image_decoding import TooMuch, check_pixels, decode_within_budget
from pipeline.types import U8

_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
_END_BYTES = 64


@dataclass(frozen=True, eq=False)
class Shot:
    """An image in one of three forms."""

    encoded: bytes | None = None
    """The JPEG file."""
    frame: Any = None
    """A video decoder's frame (PyAV)."""
    pixels: U8 | None = None
    """(H, W, 3) uint8, blue green red."""

    def bgr(self) -> U8 | None:
        """(H, W, 3) uint8; None when the image is damaged."""
        if self.pixels is not None:
            return self.pixels
        try:
            if self.frame is not None:
                check_pixels(self.frame.width, self.frame.height)
                return _converted(self.frame)
            return decode_within_budget(self.encoded or b"")
        except TooMuch:
            return None


class _OfThread(threading.local):
    converter: Any = None


_of_thread = _OfThread()


def _converted(frame: Any) -> U8:
    """A video decoder's frame as (H, W, 3) uint8. The converter that PyAV keeps in each frame starts threads, and
    hangs for good if the pipeline and the recorder convert one frame at once; this one belongs to the thread."""
    if _of_thread.converter is None:
        from av.video.reformatter import VideoReformatter  # whoever has a frame has imported PyAV already

        _of_thread.converter = VideoReformatter()
    bgr = _of_thread.converter.reformat(frame, format="bgr24", threads=1).to_ndarray()
    return np.ascontiguousarray(bgr, dtype=np.uint8)


def is_whole_jpeg(data: bytes) -> bool:
    """Whether the data starts and ends like a JPEG. A truncated JPEG decodes to grey areas, which a detector mistakes
    for road."""
    return data.startswith(_JPEG_START) and _JPEG_END in data[-_END_BYTES:]
