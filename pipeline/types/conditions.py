"""How an object is judged: the conditions that a lead must meet, the gates that show them, and how hard the car may
brake for an object."""

from __future__ import annotations

from enum import IntEnum
from typing import Generic, NamedTuple, TypeVar


class Gate(NamedTuple):
    """One test an object went through, for people to read. No decision looks at gates: decisions read ``Conditions``,
    and gates are made from the same answers."""

    name: str
    """What the test is called where it is shown."""
    value: float | None
    """The number that was tested; None when there was nothing to test."""
    limit: float
    """What it was held against."""
    passed: bool
    """Whether the object passed."""


Each = TypeVar("Each")


class Conditions(NamedTuple, Generic[Each]):
    """One value for each condition that a lead must meet, in the order in which the first failure is the reason given:
    what the object is, where it is, and only then how well it is known. So nothing in the next lane is said to wait for
    its third sighting."""

    vehicle: Each
    """Its class is a vehicle's, or not known."""
    distance: Each
    """Its distance is known."""
    size: Each
    """It is as large as a vehicle, where only its size says what it is."""
    ahead: Each
    """It is ahead of the bumper."""
    in_path: Each
    """Its sightings so far say that it is in the path."""
    confirmed: Each
    """It was seen often enough."""
    seen: Each
    """It was seen in this frame, and its distance measured."""
    placed: Each
    """Its place against the path is known well enough."""
    probable: Each
    """It exists and is in the path with enough probability."""


class Braking(IntEnum):
    """How hard the car brakes."""

    COMFORT = 0
    """As adaptive cruise control does for any lead."""
    PARTIAL = 1
    """As emergency braking begins."""
    FULL = 2
    """As hard as it can."""


Eligibility = Conditions[bool]
"""Which conditions of a lead an object meets (``pipeline.decision.gates`` decides)."""
