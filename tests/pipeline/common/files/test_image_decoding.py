"""Images beyond the budget are refused before a decoder sees them."""

from __future__ import annotations

import resource
import struct
import zlib

import cv2
import numpy as np
import pytest

from pipeline.common.files.image_decoding import MOST_PIXELS, TooMuch, decode_within_budget

GREY = np.full((24, 40, 3), 90, np.uint8)


def png_of(width: int, height: int) -> bytes:
    """A PNG that claims this size and contains almost nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    rows = chunk(b"IDAT", zlib.compress(b"\0" * 1_000_000))
    return b"\x89PNG\r\n\x1a\n" + header + rows + chunk(b"IEND", b"")


def jpeg_of(width: int, height: int) -> bytes:
    """A JPEG that claims this size."""
    data = bytearray(cv2.imencode(".jpg", GREY)[1].tobytes())
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_images_of_cameras_are_decoded(suffix: str):
    whole = cv2.imencode(suffix, GREY)[1].tobytes()
    decoded = decode_within_budget(whole)
    assert decoded is not None
    assert decoded.shape == GREY.shape


HUGE = {
    "a PNG of 40,000 × 40,000": (png_of(40_000, 40_000), "40000×40000"),
    "a JPEG of 65,000 × 65,000": (jpeg_of(65_000, 65_000), "65000×65000"),
    "a JPEG of a thousand scans": (jpeg_of(4000, 4000) + b"\xff\xda\0\0" * 1000, "scans"),
    "a TIFF": (b"II*\0" + bytes(100), "neither"),
    "nothing": (b"", "neither"),
}


@pytest.mark.parametrize("name", HUGE)
def test_what_would_take_more_than_a_camera_image_may_is_refused_unseen(name: str):
    data, why = HUGE[name]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(TooMuch, match=why):
        decode_within_budget(data)
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < MOST_PIXELS


def test_every_decoder_of_images_is_behind_it():
    """A decoder called elsewhere would have no budget."""
    from pathlib import Path

    root = Path(__file__).resolve().parents[4]
    calls = ("cv2.imdecode", "cv2.imread", "Image.open", "imageio")
    found = {
        str(path.relative_to(root))
        for folder in ("pipeline", "app")
        for path in (root / folder).rglob("*.py")
        if any(call in path.read_text(encoding="utf-8") for call in calls)
    }
    assert found - {"pipeline/common/files/image_decoding.py"} <= {
        path for path in found if path.startswith("pipeline/training/")
    }
