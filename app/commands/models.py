"""`cipv models`: list networks, download an official one, register your own ONNX file."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from app.commands.support.progress_bars import bytes_progress, task_progress
from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_writable
from pipeline.inference.model_registry import ModelEntry, known_model, list_models, own_file, pull, register, store
from pipeline.inference.model_registry import find as find_model
from pipeline.inference.runtime import ways_of
from pipeline.inference.tuning import USUAL_THREADS, is_tuned, keep_fastest, kept_gain, kept_way, settings_file, tune
from pipeline.lanes.network import open_lane_network
from pipeline.types import REAL_VEHICLES
from pipeline.vision.detector import open_detector


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
            print("\n".join(_listed(entries)))
        return 0


@dataclass(frozen=True)
class PullModel:
    """Download an official network and verify its size and SHA-256.

    Example: cipv models pull yolox_nano
    """

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name of a known network"""

    def __call__(self) -> int:
        known = known_model(self.name)
        if known.size is not None:
            print(f"{known.url}\n{known.size / 1e6:.1f} MB, licence {known.licence}, SHA-256 {known.sha256}")
        with bytes_progress() as bar:
            path = pull(self.name, task_progress(bar, self.name, known.size))
        print(f"{path}: size and checksum verified")
        return 0


@dataclass(frozen=True)
class RegisterModel:
    """Copy your own ONNX file into the model store and make it the default.

    Example: cipv models register best.onnx my_yolo
    """

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The ONNX file"""
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name to register it under"""
    task: Literal["detector", "lanes"] = "detector"
    """What the network does"""
    default: bool = True
    """Use it when no network is named"""

    def __call__(self) -> int:
        file = own_file(self.path)
        if self.task == "detector":
            open_detector(str(file), None)  # refuse now a file that no later run could use
        else:
            open_lane_network(str(file))
        print(f"{register(file, self.name, self.task, self.default)}: registered as {self.name}")
        return 0


@dataclass(frozen=True)
class TuneModel:
    """Find the fastest way to run a network on this machine, and use it from then on.

    Tries numbers of threads and the memory arena. A setting whose outputs differ in any bit is not used. Run it on an
    idle machine. The dashboard does the same by itself for a network that it uses for the first time.

    Example: cipv models tune twinlitenet
    """

    spec: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name or ONNX file"""
    threads: int = USUAL_THREADS
    """Threads of the untuned network that others are compared with"""
    rounding: bool = False
    """Also try other providers and graph optimisation levels, whose outputs differ by rounding: results then differ
    from those of an untuned network in their last digits"""

    def __call__(self) -> int:
        path = find_model(self.spec)
        if path is None:
            raise BadInput(f"no network {self.spec!r} is installed; see `cipv models list`")
        ensure_writable(settings_file())
        trials = []
        for trial in tune(ways_of(path), self.threads, self.rounding):
            trials.append(trial)
            took = f"{trial.best_ms:8.1f} ms" if trial.best_ms is not None else f"not used: {trial.refused}"
            print(f"{took}  {trial.way}")
        keep_fastest(path, trials)
        print(f"{path.stem}: {_tuned(path)}")
        return 0


@dataclass(frozen=True)
class Models:
    """Networks: list them, download an official one, register your own ONNX file, tune one for this machine."""

    action: (
        Annotated[ListModels, tyro.conf.subcommand("list")]
        | Annotated[PullModel, tyro.conf.subcommand("pull")]
        | Annotated[RegisterModel, tyro.conf.subcommand("register")]
        | Annotated[TuneModel, tyro.conf.subcommand("tune")]
    )

    def __call__(self) -> int:
        return self.action()


def _listed(entries: tuple[ModelEntry, ...]) -> Iterator[str]:
    """One paragraph per network, readable in a terminal of 80 columns, URLs included."""
    yield f"Networks in {store()} (● default)"
    for entry in entries:
        licence = f"  {entry.licence}" if entry.licence else ""
        yield f"\n{'●' if entry.default else ' '} {entry.name}  {entry.task}{licence}"
        yield f"    {entry.note}"
        if entry.task == "detector":
            yield f"    distance of a car: {_law(entry)}"
        yield from (f"    {line}" for line in _where(entry))


def _where(entry: ModelEntry) -> Iterator[str]:
    """The path of the file and how it runs, or how to get it."""
    if entry.path is not None:
        yield f"installed: {entry.path}"
        if is_tuned(entry.path):
            yield f"tuned for this machine: {_tuned(entry.path)}"
    elif entry.url is not None:
        known = known_model(entry.name)
        yield f"not installed: {known.remedy}"
        yield entry.url


def _tuned(path: Path) -> str:
    """What tuning a network's file chose, and what that gained."""
    gain, way = kept_gain(path), kept_way(path, USUAL_THREADS)
    if gain is None:
        return str(way)
    if gain.best_ms >= gain.usual_ms:
        return f"nothing is faster than the default ({way})"
    return f"{way}, {gain.usual_ms / gain.best_ms:.2f} times as fast as the default"


def _law(entry: ModelEntry) -> str:
    law, whose = (entry.law, "its own law") if entry.law is not None else (REAL_VEHICLES, "the law of real cars")
    return f"{law.coefficient:.0f} · h^{law.exponent:g} m, h pixels high at {law.focal_px:.0f} px ({whose})"
