"""An image as the camera sent it, decoded only on demand: with a 60 Hz camera, five of six images are never decoded."""

from __future__ import annotations

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
                return np.ascontiguousarray(self.frame.to_ndarray(format="bgr24"), dtype=np.uint8)
            return decode_within_budget(self.encoded or b"")
        except TooMuch:
            return None


def is_whole_jpeg(data: bytes) -> bool:
    """Whether the data starts and ends like a JPEG. A truncated JPEG decodes to grey areas, which a detector mistakes
    for road."""
    return data.startswith(_JPEG_START) and _JPEG_END in data[-_END_BYTES:]
