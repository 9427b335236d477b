"""The scenarios that come with the simulator, by name. Listing them imports no simulator."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent / "scenarios"


def names() -> tuple[str, ...]:
    """Every built-in scenario, in alphabetical order."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def offers() -> list[tuple[str, str]]:
    """(name, title) of every built-in scenario, for a list to choose from."""
    return [(name, f"Simulation · {name.replace('_', ' ')}") for name in names()]
