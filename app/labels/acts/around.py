"""The frames around an observation of a vehicle: sweeps and ego motion of the open recording."""

from __future__ import annotations

from functools import lru_cache

from app.drive.open_recording import OpenRecording
from app.drive.run_results import moments_of
from pipeline.labels.cuboids.aggregate import MOST_SWEEPS, Aggregate, Sweeps, aggregated
from pipeline.labels.cuboids.points_of import Clustered, clustered
from pipeline.labels.headings import Pose, own_poses
from pipeline.labels.model import LabelTrack, Sighting

_KEPT = 64
"""Number of cached sweeps: neighbouring frames need the same ones."""
_FRAMES = 4 * MOST_SWEEPS
"""Number of frames on each side in which sweeps are used."""


def sweeps_of(recording: OpenRecording) -> Sweeps:
    """The sweep of a frame with its clusters, None if it has none; recently used ones are cached."""

    @lru_cache(_KEPT)
    def of(index: int) -> Clustered | None:
        sweep = recording.at_hand(index).sweep
        return clustered(sweep.points) if sweep is not None else None

    return of


def poses_around(recording: OpenRecording, frame: int, reach: int = _FRAMES) -> dict[int, Pose]:
    """Own motion from the current run, as far as it has progressed."""
    run = recording.runs.current
    if run is None:
        return {}
    first = max(frame - reach, 0)
    moments = moments_of(run.rows(first)[: 2 * reach + 1])
    return own_poses({first + index: each for index, each in moments.items()})


def around(recording: OpenRecording, track: LabelTrack, sighting: Sighting, sweeps: Sweeps) -> Aggregate | None:
    """The points of a labelled vehicle in the sweeps around a frame; None without points."""
    near = [each for each in track.sightings if abs(each.frame - sighting.frame) <= _FRAMES]
    return aggregated(near, sighting.frame, sweeps, poses_around(recording, sighting.frame))
