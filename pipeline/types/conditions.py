"""How an object is judged: the conditions that a lead must meet, the gates that show them, and how hard the car may
brake for an object."""

from __future__ import annotations

from enum import IntEnum
from typing import Generic, NamedTuple, TypeVar


class Gate(NamedTuple):
    """One test of an object, for display only. Decisions read ``Conditions``; gates are made from the same answers."""

    name: str
    """Name of the test as shown to the user."""
    value: float | None
    """The tested value; None when there was nothing to test."""
    limit: float
    """The limit that the value is compared with."""
    passed: bool
    """Whether the object passed."""


Each = TypeVar("Each")


class Conditions(NamedTuple, Generic[Each]):
    """One value for each condition that a lead must meet. The first failed condition is the reason that is shown, so
    the order is: what the object is, where it is, and only then how well it is known. This way an object in the next
    lane is never reported as waiting for its third sighting."""

    vehicle: Each
    """Its class is a vehicle class, or unknown."""
    distance: Each
    """Its distance is known."""
    size: Each
    """It is as large as a vehicle. Tested only if no class is known."""
    ahead: Each
    """It is ahead of the bumper."""
    stays: Each
    """It does not cross the path, or will still be in it when the car arrives."""
    in_path: Each
    """According to all sightings so far, it is in the path."""
    confirmed: Each
    """It has been seen often enough."""
    seen: Each
    """It was seen in this frame and its distance was measured."""
    placed: Each
    """Its position relative to the path is known well enough."""
    probable: Each
    """The probability that it exists and is in the path is high enough."""


class Braking(IntEnum):
    """How hard the car brakes."""

    COMFORT = 0
    """Like adaptive cruise control for any lead."""
    PARTIAL = 1
    """First level of emergency braking."""
    FULL = 2
    """As hard as the car can."""


Eligibility = Conditions[bool]
"""Which lead conditions an object meets (decided in ``pipeline.decision.gates``)."""
