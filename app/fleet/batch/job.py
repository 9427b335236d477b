"""A drive of a batch: what a worker gets, and what it returns."""

from __future__ import annotations

from dataclasses import dataclass

from app.fleet.batch.addresses import Recording
from app.fleet.batch.answers import PIECE_FRAMES, answers_file
from app.fleet.batch.keys import RunKey
from app.fleet.store import Store
from pipeline.detection import DetectorChoice, Detectors


@dataclass(frozen=True)
class Job:
    """One drive of a batch."""

    recording: Recording
    """What is run, as it was when the batch was planned."""
    key: RunKey
    """Parameters, sensors and rings, and the code and networks that a worker must have to run it."""
    choice: DetectorChoice
    """Networks by name, opened by the worker from its own files."""
    store: Store
    """Where tables, answers of networks and marks of what is done are written."""
    keeps_results: bool = False
    """Also write the results as JSON lines."""
    piece_frames: int = PIECE_FRAMES
    """Images of a longer recording are looked at in pieces of so many frames."""

    def answers(self, detectors: Detectors, first: int) -> str:
        """Store name of these detectors' detections in the piece that begins with frame ``first``."""
        return answers_file(self.recording.mark, detectors, first, self.piece_frames)

    @property
    def done_file(self) -> str:
        """Name of the file whose presence means that all of the drive's files are complete."""
        return done_file(self.key.name, self.recording)


@dataclass(frozen=True)
class Outcome:
    """What became of a drive."""

    drive: str
    """Its name in tables, ``Recording.drive``."""
    frames: int
    """0 for one that was set aside."""
    looked_at: int
    """Images that networks looked at now."""
    seconds: float
    """It took."""
    reason: str = ""
    """Why it was set aside; empty for one that was run."""


@dataclass(frozen=True)
class TooLong:
    """A recording whose images several workers should process first."""

    pieces: tuple[int, ...]
    """First frame of each piece."""


def done_file(run: str, recording: Recording) -> str:
    """Store name of the file that marks a drive as done."""
    return f"done/run={run}/{recording.drive}.{recording.mark}.json"


def aside_file(run: str, recording: Recording) -> str:
    """Store name of the file that says why a recording was set aside."""
    return f"aside/run={run}/{recording.drive}.{recording.mark}.json"
