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
    """The recording in its state when the batch was planned."""
    key: RunKey
    """Parameters, sensors and rings, and the code and networks that a worker must have."""
    choice: DetectorChoice
    """Networks by name, opened by the worker from its own files."""
    store: Store
    """Storage of tables, detections and markers of finished drives."""
    keeps_results: bool = False
    """Also write the results as JSON lines."""
    piece_frames: int = PIECE_FRAMES
    """Images of a longer recording are processed in pieces of this many frames."""

    def answers(self, detectors: Detectors, first: int) -> str:
        """Store name of these detectors' detections in the piece that begins with frame ``first``."""
        return answers_file(self.recording.mark, detectors, first, self.piece_frames)

    def reason(self, text: str) -> str:
        """A message about the recording without its address in front, which is printed beside it."""
        _, _, path = self.recording.address.partition(":")
        return text.removeprefix(f"{self.recording.address}: ").removeprefix(f"{path}: ")

    @property
    def done_file(self) -> str:
        """Name of the file whose presence means that all of the drive's files are complete."""
        return done_file(self.key.name, self.recording)


@dataclass(frozen=True)
class Outcome:
    """Result of one drive."""

    drive: str
    """Its name in tables, ``Recording.drive``."""
    frames: int
    """0 if it was set aside."""
    looked_at: int
    """Number of images processed by networks in this run."""
    seconds: float
    """Computing time."""
    reason: str = ""
    """Why it was set aside; empty if it was run."""


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
