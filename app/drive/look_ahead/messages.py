"""Messages between the server and its process for background networks. The pixels of an image follow its message, so
that they are not copied into it."""

from __future__ import annotations

import msgspec

from app.core.kept_detections import DetectionRow
from pipeline.lanes.horizon import ImageOutline
from pipeline.types import PixelWindow


class NetworkFile(msgspec.Struct, frozen=True):
    """A network to open."""

    name: str
    """Under which the opened network must present itself: equal names give equal detections."""
    path: str
    """Its ONNX file."""
    threads: int
    """Threads of one run."""
    input_size: tuple[int, int]
    """(height, width)."""
    outline: ImageOutline | None
    """For a lane network, of what it sees; None for a vehicle detector."""
    window: PixelWindow | None = None
    """For a lane network, the part of the image that it sees; None for the whole image."""


class Networks(msgspec.Struct):
    """The first message to the process."""

    files: tuple[NetworkFile, ...]
    """All networks that it will run."""


class ImageHeader(msgspec.Struct):
    """An image for a network. Its pixels follow the message."""

    network: int
    """Index in ``Networks.files``."""
    height: int
    """Rows."""
    width: int
    """Columns."""


class NetworkReply(msgspec.Struct):
    """The process's reply to every message."""

    row: DetectionRow | None = None
    """The detections; None once the networks are open, and after a failure."""
    error: str = ""
    """Why it failed."""
