"""The state of a recording, as the page and the API show it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class RecordingState:
    """State of a recording."""

    file: Path
    """The newest of ``files``."""
    files: tuple[Path, ...]
    """In order of time."""
    frames: int
    """Number written so far, over all files."""
    seconds: float
    """Duration over all files."""
    bytes: int
    """Size over all files."""
    dropped: int
    """Frames, batches of packets, sweeps, images and samples dropped because the queue was full."""
    error: str | None
    """Why it ended by itself; None without an error."""
    dropped_because: str | None = None
    """What was too slow when data was last dropped; None if nothing was."""
    trouble: str | None = None
    """What is wrong while recording goes on: the disk does not respond, or, for a minute, that writing hung and was
    restarted; None otherwise."""

    def to_json(self) -> dict[str, Any]:
        """In the format of the page and ``/api/recording``."""
        return {
            "file": str(self.file),
            "frames": self.frames,
            "seconds": round(self.seconds, 3),
            "bytes": self.bytes,
            "dropped": self.dropped,
            "error": self.error,
            "dropped_because": self.dropped_because,
            "trouble": self.trouble,
        }
