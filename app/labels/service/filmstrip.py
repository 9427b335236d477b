"""An overview of a track: its keyframes, and the frames in which it fits its points worst."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from app.drive.open_recording import OpenRecording
from pipeline.alignment.projection import resolve
from pipeline.labels.close_up import Fit, close_up, fit_of
from pipeline.labels.model import LabelTrack, Sighting
from pipeline.params import Params

_MOST_KEYFRAMES = 8
_WORST = 4
_MOST_READ = 60
"""Maximum frames whose points are read: a long track is sampled."""
_JPEG_QUALITY = 80
Why = Literal["keyframe", "end", "fits worst"]


@dataclass(frozen=True)
class Still:
    """One frame of a track's filmstrip."""

    frame: int
    """Of the drive, from 0."""
    why: Why
    """Why this frame was chosen."""
    fit: Fit | None
    """How well its cuboid fits the points; None if it has no cuboid, or the frame has no points."""


def filmstrip(track: LabelTrack, recording: OpenRecording) -> list[Still]:
    """By frame: both ends, keyframes (a sample if there are many), and the other frames with the most points beside the
    cuboid."""
    why: dict[int, Why] = {each.frame: "end" for each in (*track.sightings[:1], *track.sightings[-1:])}
    keys = [each for each in track.sightings if each.keyframe]
    why |= {each.frame: "keyframe" for each in sampled(keys, _MOST_KEYFRAMES)}
    read = {each.frame: _fit(each, recording) for each in sampled(track.sightings, _MOST_READ)}
    read |= {each.frame: _fit(each, recording) for each in track.sightings if each.frame in why}
    misfits = sorted(
        ((fit.share_beside or 0.0, frame) for frame, fit in read.items() if fit is not None and frame not in why),
        reverse=True,
    )
    why |= {frame: "fits worst" for share, frame in misfits[:_WORST] if share > 0.0}
    return [Still(frame, why[frame], read[frame]) for frame in sorted(why)]


def sampled(sightings: Sequence[Sighting], most: int) -> list[Sighting]:
    """First, last and some evenly spaced in between."""
    places = np.unique(np.linspace(0, len(sightings) - 1, min(most, len(sightings))).round().astype(int))
    return [sightings[place] for place in places]


def close_up_jpeg(track: LabelTrack, index: int, recording: OpenRecording, params: Params) -> bytes | None:
    """Image of a track in one frame; None if it is not in the frame."""
    sighting = track.at(index)
    if sighting is None:
        return None
    frame = recording.as_read(index)
    drawn = close_up(frame, sighting, resolve(params.alignment, frame.camera))
    return cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _fit(sighting: Sighting, recording: OpenRecording) -> Fit | None:
    sweep = recording.input(sighting.frame).sweep if sighting.cuboid is not None else None
    return fit_of(sweep.points, sighting.cuboid) if sweep is not None and sighting.cuboid is not None else None
