"""Sizes of vehicles and people: typical ones, for the sides that were not measured, and largest ones."""

from __future__ import annotations

USUAL_SIZE_M: dict[str, tuple[float, float, float]] = {
    "car": (4.5, 1.8, 1.5),
    "truck": (8.0, 2.5, 3.2),
    "bus": (11.0, 2.55, 3.2),
    "motorcycle": (2.1, 0.8, 1.5),
    "bicycle": (1.8, 0.6, 1.7),
    "person": (0.6, 0.6, 1.75),
}
"""Length, width, height by class."""


def usual_size_m(label: str) -> tuple[float, float, float]:
    """Length, width, height of a class; unknown classes count as a car."""
    return USUAL_SIZE_M.get(label, USUAL_SIZE_M["car"])


LARGEST_SIZE_M: dict[str, tuple[float, float, float]] = {
    "car": (8.0, 2.6, 3.2),
    "truck": (20.0, 3.2, 4.5),
    "bus": (20.0, 3.2, 4.5),
    "motorcycle": (3.5, 1.5, 2.2),
    "bicycle": (3.0, 1.3, 2.3),
    "person": (2.0, 1.5, 2.3),
}
"""Length, width, height of the largest vehicles of a class, with half a metre or more of length for cluster noise: the
longest vans, which detectors call cars (7.4 m), lorries with a trailer (18.75 m long, 2.6 m wide without mirrors, 4 m
tall, Directive 96/53/EC), tandems, cargo bicycles."""

LONGEST_M: dict[str, float] = {label: size[0] for label, size in LARGEST_SIZE_M.items()}


def largest_size_m(label: str) -> tuple[float, float, float]:
    """Length, width, height of the largest vehicles of a class; unknown classes count as a car."""
    return LARGEST_SIZE_M.get(label, LARGEST_SIZE_M["car"])
