"""The checks of a drive's labels, kept until somebody changes them."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from app.drive.open_recording import OpenRecording
from app.labels.store.drive_labels import DriveLabels
from app.labels.transfer.files import drive_for
from pipeline.labels.close_up import fit_of
from pipeline.labels.model import LabelSet, LabelTrack
from pipeline.labels.plausibility import Problem, problems

_NEAR_M = 30.0
"""Nearer than this a vehicle has points, where there is a sweep."""
_MOST_READ = 200


@dataclass(frozen=True)
class Checked:
    """revision: of the labels that were looked at."""

    revision: int
    problems: tuple[Problem, ...]


class LabelChecks:
    """Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: DriveLabels | None = None
        self._found = Checked(-1, ())

    def of(self, labels: DriveLabels, recording: OpenRecording) -> Checked:
        """What can hardly be so, by frame."""
        with self._lock:
            revision = labels.revision
            if self._of is not labels or self._found.revision != revision:
                known = labels.unnamed_set()
                found = [*problems(known, drive_for(recording)), *_empty(known, recording)]
                self._found = Checked(revision, tuple(sorted(found, key=lambda each: each.frame)))
                self._of = labels
            return self._found


def _empty(labels: LabelSet, recording: OpenRecording) -> list[Problem]:
    """Near cuboids without a single point, one frame of each track, and only of what people stand behind."""
    found: list[Problem] = []
    for track in [each for each in labels.tracks if each.state in ("accepted", "corrected")][:_MOST_READ]:
        frame = _nearest(track)
        if frame is None:
            continue
        sighting, sweep = track.at(frame), recording.input(frame).sweep
        if sighting is None or sighting.cuboid is None or sweep is None:
            continue
        if not fit_of(sweep.points, sighting.cuboid).inside:
            found.append(Problem(frame, track.id, f"#{track.id} {track.label}: there are no points in its cuboid"))
    return found


def _nearest(track: LabelTrack) -> int | None:
    """The frame in which it is nearest; None where it never is near, ahead of us."""
    ahead = [
        (each.cuboid.center[0], each.frame)
        for each in track.sightings
        if each.cuboid is not None and 0.0 < each.cuboid.center[0] < _NEAR_M and abs(each.cuboid.center[1]) < _NEAR_M
    ]
    return min(ahead)[1] if ahead else None
