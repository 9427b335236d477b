"""Responses of /api/labels about the positions of vehicles in frames, as types."""

from __future__ import annotations

from app.web.routes.labels.shapes import StatedItem
from app.web.routes.shapes.common import ApiModel, CuboidJson
from pipeline.labels.model import Heading


class PlacedJson(ApiModel):
    """Where a vehicle is in a frame."""

    cuboid: CuboidJson | None
    """Ego frame; null where it is only seen in the image."""
    bbox: tuple[float, float, float, float] | None
    """x1 y1 x2 y2 in pixels of the raw image; null where it is outside."""
    keyframe: bool
    """A person or a file put it there; else it follows those that are."""
    box_set: bool
    """Somebody set the box; else it is where the cuboid is in the image."""


class PlacedTrack(PlacedJson):
    """A track in the frame."""

    track: int
    """Its id."""


class PlacedFrame(PlacedJson):
    """A frame of the track."""

    frame: int
    """Of the drive, from 0."""


class Window(ApiModel):
    """All sightings in a window of frames."""

    revision: int
    """Of the labels."""
    sightings: dict[int, list[PlacedTrack]]
    """Of the frames that were asked for."""


class WholeTrack(StatedItem):
    """A track with every sighting."""

    label: str
    """Class of the vehicle."""
    confidence: float | None
    """As of ``TrackHead``."""
    heading: Heading
    """As of ``TrackHead``."""
    sightings: list[PlacedFrame]
    """By frame."""
