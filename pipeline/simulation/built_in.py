"""The scenarios that come with the simulator, by name. Listing them imports no simulator."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import yaml

FOLDER = Path(__file__).parent / "scenarios"


def names() -> tuple[str, ...]:
    """Every built-in scenario, in alphabetical order."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.yaml")))


def offers() -> list[tuple[str, str]]:
    """(name, title) of every built-in scenario, for a list to choose from."""
    return [(name, _title(name)) for name in names()]


@cache
def _title(name: str) -> str:
    """From its file; the rest of the file is not read."""
    with (FOLDER / f"{name}.yaml").open(encoding="utf-8") as lines:
        return next((str(yaml.safe_load(line)["title"]) for line in lines if line.startswith("title:")), name)
