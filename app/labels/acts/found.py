"""Acts whose numbers are computed from sensor data. Clients cannot send them."""

from __future__ import annotations

from typing import Literal

from app.labels.acts.request_fields import OfTrack, Placed, Word


class AddSightings(OfTrack):
    """Result of a ``Propagate`` after the track was followed."""

    kind: Literal["propagate"]
    sightings: tuple[Placed, ...]
    """The new keyframes."""


class AddMeasured(Placed):
    """Result of a ``Lift`` after the vehicle was measured."""

    kind: Literal["lift"]
    label: Word
    """Class of the vehicle."""
    how: str
    """How it was measured, in words."""
