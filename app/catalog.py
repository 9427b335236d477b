"""Recordings that the page can offer without a path being typed: the simulator's scenarios and known data folders."""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

_PROJECT = Path(__file__).resolve().parent.parent
_FOLDERS = (("lidar_vlp16", "astyx"), ("velodyne", "kitti"), ("velodyne_points", "kitti"))


def catalog() -> list[tuple[str, str]]:
    """(uri, title) pairs: scenarios, then the recordings right below ``CIPV_DATA`` and ``sessions``."""
    return [*scenarios(), *recordings()]


def scenarios() -> list[tuple[str, str]]:
    """(uri, title) of the simulator's built-in scenarios, by name."""
    folder = resources.files("pipeline.simulation") / "scenarios"
    names = sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml"))
    return [(f"sim:{name}", f"Simulation · {name.replace('_', ' ')}") for name in names]


def recordings() -> list[tuple[str, str]]:
    """(uri, title) of the folders right below ``CIPV_DATA`` and ``sessions`` that look like a known recording.

    Without the variable, the folder is ``shared/data`` beside the project."""
    data = Path(os.environ.get("CIPV_DATA") or _PROJECT.parent / "shared" / "data")
    found = []
    for root in (data, _PROJECT / "sessions"):
        for folder in sorted(root.iterdir()) if root.is_dir() else ():
            scheme = next((scheme for mark, scheme in _FOLDERS if (folder / mark).is_dir()), None)
            if scheme is not None:
                found.append((f"{scheme}:{folder}", f"{scheme} · {folder.name}"))
    return found
