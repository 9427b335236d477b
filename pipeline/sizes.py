"""How large vehicles and people mostly are: one table, for the sides of them that nobody has measured."""

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
    """Length, width, height of a class; what is none of them counts as a car."""
    return USUAL_SIZE_M.get(label, USUAL_SIZE_M["car"])
