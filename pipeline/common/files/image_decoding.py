"""Decodes compressed images of files, bags, sessions and streams. No other module decodes images.

A decoder trusts the header: a PNG of 130 kB may request 6 GB, a JPEG a thousand passes over its pixels. The header is
therefore checked first, and images larger than a camera's are never decoded.
"""

from __future__ import annotations

import struct

import cv2
import numpy as np
import numpy.typing as npt

MOST_PIXELS = 50_000_000
"""About four times the 12 megapixels of the largest automotive cameras; 150 MB as blue, green and red."""
LARGEST_BYTES = 64 << 20
"""More than an image of this size takes even as a barely compressible PNG."""
_MOST_PASSES = 1_000_000_000
"""Pixels × scans of a progressive JPEG, since each scan visits every pixel; the limit is a few seconds of decoding.
Encoders make about ten scans."""
_PNG, _PNG_HEADER = b"\x89PNG\r\n\x1a\n", struct.Struct(">I4sII")
_JPEG, _SCAN = b"\xff\xd8", b"\xff\xda"
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
"""JPEG markers that are followed by the image size (ITU-T T.81, table B.1)."""
_BARE = frozenset({0x01, *range(0xD0, 0xD9)})
"""Markers without a length field."""


class TooMuch(ValueError):
    """An image over the budget, or of a format whose size cannot be determined before decoding; the text is the
    reason."""


def decode_within_budget(data: bytes) -> npt.NDArray[np.uint8] | None:
    """(H, W, 3) uint8, blue green red, of a JPEG or PNG; None if it is damaged. Raises TooMuch before decoding."""
    check_budget(data)
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_COLOR)
    except (cv2.error, MemoryError):
        return None
    return None if image is None else np.ascontiguousarray(image, dtype=np.uint8)


def check_budget(data: bytes) -> None:
    """TooMuch if a compressed image would take more bytes, pixels or time than that of any real camera."""
    if len(data) > LARGEST_BYTES:
        raise TooMuch(f"an image larger than {LARGEST_BYTES >> 20} MiB")
    size = _size_of(data)
    if size is None:
        raise TooMuch("neither a JPEG nor a PNG")
    check_pixels(*size)
    if data.startswith(_JPEG) and data.count(_SCAN) * size[0] * size[1] > _MOST_PASSES:
        raise TooMuch("a JPEG with too many scans")


def check_pixels(width: int, height: int) -> None:
    """TooMuch if an image or video frame is larger than that of any real camera."""
    if width * height > MOST_PIXELS:
        raise TooMuch(f"an image of {width}×{height} pixels")


def _size_of(data: bytes) -> tuple[int, int] | None:
    """Width and height from the header; None if it is neither a JPEG nor a PNG."""
    if data.startswith(_PNG) and len(data) >= len(_PNG) + _PNG_HEADER.size:
        _, kind, width, height = _PNG_HEADER.unpack_from(data, len(_PNG))
        return (width, height) if kind == b"IHDR" else None
    return _jpeg_size(data) if data.startswith(_JPEG) else None


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    at = len(_JPEG)
    while at + 9 <= len(data):
        if data[at] != 0xFF or data[at + 1] == 0xFF or data[at + 1] in _BARE:
            at += 1 if data[at] != 0xFF or data[at + 1] == 0xFF else 2
            continue
        if data[at + 1] in _FRAMES:
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return None
