"""`cipv models`: which networks are known and here, fetching an official one, registering a file of one's own."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console
from rich.table import Table

from app.progress import bytes_progress
from pipeline.path.lane_network import open_lane_network
from pipeline.types import REAL_VEHICLES
from pipeline.vision.detector import open_detector
from pipeline.vision.models import ModelEntry, known_model, list_models, pull, register, store


@dataclass(frozen=True)
class ListModels:
    """List known and registered networks.

    Example: cipv models list
    """

    json: bool = False
    """Print the list as JSON"""

    def __call__(self) -> int:
        entries = list_models()
        if self.json:
            rows = [{**asdict(entry), "path": str(entry.path) if entry.path else None} for entry in entries]
            print(json.dumps(rows, indent=1))
        else:
            Console().print(_table(entries))
        return 0


@dataclass(frozen=True)
class PullModel:
    """Fetch an official network; its size and SHA-256 are checked.

    Example: cipv models pull yolox_nano
    """

    name: tyro.conf.Positional[str]
    """Name of a known network"""

    def __call__(self) -> int:
        known = known_model(self.name)
        if known.size is not None:
            print(f"{known.url}\n{known.size / 1e6:.1f} MB, licence {known.licence}, SHA-256 {known.sha256}")
        with bytes_progress() as bar:
            task = bar.add_task(self.name, total=known.size)
            path = pull(self.name, lambda done, total: bar.update(task, completed=done, total=total))
        print(f"{path}: size and checksum are right")
        return 0


@dataclass(frozen=True)
class RegisterModel:
    """Copy an ONNX file of your own into the store and make it the default.

    Example: cipv models register best.onnx my_yolo
    """

    path: tyro.conf.Positional[Path]
    """The ONNX file"""
    name: tyro.conf.Positional[str]
    """The name to call it by"""
    task: Literal["detector", "lanes"] = "detector"
    """What the network does"""
    default: bool = True
    """Use it when no network is named"""

    def __call__(self) -> int:
        if self.task == "detector":
            open_detector(str(self.path), None)  # refuse here what no later run could use
        else:
            open_lane_network(str(self.path))
        print(f"{register(self.path, self.name, self.task, self.default)}: registered as {self.name}")
        return 0


@dataclass(frozen=True)
class Models:
    """Networks: which are here, fetch an official one, add your own ONNX file."""

    action: (
        Annotated[ListModels, tyro.conf.subcommand("list")]
        | Annotated[PullModel, tyro.conf.subcommand("pull")]
        | Annotated[RegisterModel, tyro.conf.subcommand("register")]
    )

    def __call__(self) -> int:
        return self.action()


def _table(entries: tuple[ModelEntry, ...]) -> Table:
    table = Table("", "name", "task", "licence", "here", "what it is", "distance law", title=f"Networks in {store()}")
    for entry in entries:
        mark, path = "●" if entry.default else "", str(entry.path or "—")
        table.add_row(mark, entry.name, entry.task, entry.licence or "", path, entry.note, _law(entry))
    table.caption = "● used when none is named; distance law: of cars, by box height h at that focal length"
    return table


def _law(entry: ModelEntry) -> str:
    if entry.task != "detector":
        return ""
    law, whose = (entry.law, "its own") if entry.law is not None else (REAL_VEHICLES, "for real cars")
    return f"{law.coefficient:.0f} · h^{law.exponent:g} at {law.focal_px:.0f} px, {whose}"
