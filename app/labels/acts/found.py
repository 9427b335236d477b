"""Acts whose numbers are computed from sensor data. Clients cannot send them."""

from __future__ import annotations

from typing import Literal

from app.labels.acts.request_fields import OfTrack, Placed, Word


class AddSightings(OfTrack):
    """What a ``Propagate`` becomes once the track is followed."""

    kind: Literal["propagate"]
    sightings: tuple[Placed, ...]
    """The new keyframes."""


class AddMeasured(Placed):
    """What a ``Lift`` becomes once the vehicle is measured."""

    kind: Literal["lift"]
    label: Word
    """Class of the vehicle."""
    how: str
    """What it was measured by, in words."""
