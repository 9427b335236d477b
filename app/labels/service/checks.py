"""The plausibility checks of a drive's labels, cached until a label changes."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import numpy as np

from app.drive.open_recording import OpenRecording
from app.labels.store.drive_labels import DriveLabels
from app.labels.transfer.files import drive_for
from pipeline.common.geometry import Cuboid
from pipeline.labels.close_up import fit_of
from pipeline.labels.model import COUNTED_STATES, LabelSet, LabelTrack
from pipeline.labels.plausibility import Problem, problems
from pipeline.lidar.ground import fit_ground
from pipeline.params import GroundParams
from pipeline.types import F32

_NEAR_M = 30.0
"""Closer than this, a vehicle has points if there is a sweep."""
_MOST_READ = 200
_OFF_ROAD_M = 0.5
"""Of the labelled vehicles of Astyx and KITTI 0009 within 30 m, none is more than 0.2 m off."""
_AROUND_M, _FEWEST_AROUND = 4.0, 5
"""Ground points within this distance of the cuboid; with fewer of them, the plane alone is compared."""


@dataclass(frozen=True)
class Checked:
    """What the checks found at one revision."""

    revision: int
    """Revision of the checked labels; newer labels are checked again."""
    problems: tuple[Problem, ...]
    """In order of frames."""


class LabelChecks:
    """Any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: DriveLabels | None = None
        self._found = Checked(-1, ())

    def of(self, labels: DriveLabels, recording: OpenRecording) -> Checked:
        """Implausible labels, by frame."""
        with self._lock:
            revision = labels.revision
            if self._of is not labels or self._found.revision != revision:
                known = labels.unnamed_set()
                found = [*problems(known, drive_for(recording)), *_empty(known, recording)]
                self._found = Checked(revision, tuple(sorted(found, key=lambda each: each.frame)))
                self._of = labels
            return self._found


def _empty(labels: LabelSet, recording: OpenRecording) -> list[Problem]:
    """Near cuboids without a single point, or below or above the road: one frame per track, and only labels accepted by
    people."""
    found: list[Problem] = []
    for track in [each for each in labels.tracks if each.state in COUNTED_STATES][:_MOST_READ]:
        frame = _nearest(track)
        if frame is None:
            continue
        sighting, sweep = track.at(frame), recording.input(frame).sweep
        if sighting is None or sighting.cuboid is None or sweep is None:
            continue
        if not fit_of(sweep.points, sighting.cuboid).inside:
            found.append(Problem(frame, track.id, f"#{track.id} {track.label}: no points in its cuboid"))
        off_m = above_road_m(sweep.points, sighting.cuboid)
        if abs(off_m) > _OFF_ROAD_M:
            where = "above" if off_m > 0 else "below"
            words = f"#{track.id} {track.label}: its bottom is {abs(off_m):.1f} m {where} the road"
            found.append(Problem(frame, track.id, words))
    return found


def above_road_m(points: F32, cuboid: Cuboid) -> float:
    """Height of its bottom above the ground there; 0 without a fitted ground. Where a road bends upwards, a plane may
    be more than a metre off beside it (KITTI 0009), so the ground points around decide, unless the plane is closer."""
    ground = fit_ground(points, np.ones(len(points), dtype=bool), GroundParams())
    plane_m = float(ground.height(np.array([cuboid.center[:2]]))[0])
    if not math.isfinite(plane_m):
        return 0.0
    bottom_m = cuboid.center[2] - cuboid.size[2] / 2
    away_m = np.hypot(points[:, 0] - cuboid.center[0], points[:, 1] - cuboid.center[1])
    around = ground.mask & (away_m < _AROUND_M)
    if np.count_nonzero(around) < _FEWEST_AROUND:
        return bottom_m - plane_m
    by_points, by_plane = bottom_m - float(np.median(points[around, 2])), bottom_m - plane_m
    return min(by_points, by_plane, key=abs) if by_points * by_plane > 0 else by_points


def _nearest(track: LabelTrack) -> int | None:
    """The frame in which it is nearest; None if it is never near and ahead of us."""
    ahead = [
        (each.cuboid.center[0], each.frame)
        for each in track.sightings
        if each.cuboid is not None and 0.0 < each.cuboid.center[0] < _NEAR_M and abs(each.cuboid.center[1]) < _NEAR_M
    ]
    return min(ahead)[1] if ahead else None
