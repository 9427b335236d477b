"""Finds the fastest way to run a network on this machine, and stores it next to the networks.

A stored setting belongs to a file, a processor and a version of onnxruntime; with any other, the network runs untuned.

The results of a recording must not depend on whether a network was tuned, so a setting is only stored if the outputs
are equal bit by bit. This holds for the number of threads, which share the rows of a layer's output, and for the memory
arena. It does not hold for levels of graph optimisation and for other providers, which sum in another order; those are
tried only where that is asked for (``rounding``).
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import onnxruntime as ort

from pipeline.common.fast_replace import evolve
from pipeline.common.files.data_dir import file_sha256
from pipeline.common.files.whole_files import replace_text
from pipeline.inference.model_registry import store
from pipeline.types import F32

PROVIDERS = ("TensorrtExecutionProvider", "CUDAExecutionProvider", "OpenVINOExecutionProvider", "CPUExecutionProvider")
"""Possible providers, in the order of preference without tuning (which excludes OpenVINO)."""
_UNTUNED = tuple(name for name in PROVIDERS if name != "OpenVINOExecutionProvider")
USUAL_THREADS = 2
"""Threads of an untuned network."""
_AGREE = 1e-3
"""With ``rounding``: largest permitted difference of an output, relative to its largest value. It allows another order
of summation, but no lower precision."""
_WORTH = 0.97
"""To be preferred, settings must take less than this share of the best time so far: smaller differences are noise."""
_ROUNDS, _ROUNDS_IN_TURNS = 7, 15


@dataclass(frozen=True)
class RunSettings:
    """Settings for running a network."""

    providers: tuple[str, ...]
    """Providers of onnxruntime, in the order in which they are tried for each node."""
    threads: int
    """Threads per run."""
    optimisation: str = "ORT_ENABLE_ALL"
    """Level of graph optimisation, onnxruntime's name."""
    arena: bool = True
    """Whether memory is kept between runs."""

    def __str__(self) -> str:
        level = self.optimisation.removeprefix("ORT_").replace("_", " ").lower()
        return f"{_short(self.providers[0])}, {self.threads} threads, {level}, {'with' if self.arena else 'no'} arena"


@dataclass(frozen=True)
class Gain:
    """Times of a run, measured in turns. Both are equal if nothing was faster than the default settings."""

    usual_ms: float
    """With the default settings."""
    best_ms: float
    """With the stored ones."""


@dataclass(frozen=True)
class Trial:
    """Measurement of one setting."""

    way: RunSettings
    """The tested providers, threads and options."""
    best_ms: float | None
    """The shortest of its runs, because other load only adds time. None if it failed or its outputs differ."""
    refused: str = ""
    """The reason if it was refused."""


def untuned(threads: int) -> RunSettings:
    """Settings without tuning: the best installed provider."""
    there = ort.get_available_providers()
    return RunSettings(tuple(name for name in _UNTUNED if name in there), threads)


def kept_way(path: Path, threads: int) -> RunSettings:
    """The tuned settings for a network's file on this machine, or the default ones."""
    rows, usual = _read(settings_file()), untuned(threads)
    row = rows.get(_key(path)) if rows else None
    if row is None:
        return usual
    try:
        way = RunSettings(tuple(row["providers"]), int(row["threads"]), str(row["optimisation"]), bool(row["arena"]))
    except (KeyError, TypeError, ValueError, OverflowError):
        return usual
    known = hasattr(ort.GraphOptimizationLevel, way.optimisation) and 1 <= way.threads <= 64
    return way if known and set(way.providers) <= set(ort.get_available_providers()) else usual


def is_tuned(path: Path) -> bool:
    """Whether settings are stored for a network's file on this machine."""
    return _key(path) in _read(settings_file())


def keep(path: Path, way: RunSettings, gain: Gain | None = None) -> None:
    """Use these settings for this file's network from now on. OSError if the store cannot be written."""
    file = settings_file()
    row = asdict(way) | (asdict(gain) if gain is not None else {})
    replace_text(file, json.dumps(_read(file) | {_key(path): row}, indent=1, sort_keys=True) + "\n")


def kept_gain(path: Path) -> Gain | None:
    """What the stored settings for a network's file gained on this machine; None if nothing is stored."""
    row = _read(settings_file()).get(_key(path), {})
    try:
        return Gain(float(row["usual_ms"]), float(row["best_ms"]))
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def tune(
    run: Callable[[RunSettings], Callable[[], Sequence[F32]]], threads: int, rounding: bool = False
) -> Iterator[Trial]:
    """Try all settings, the default first; then the best so far is varied in one setting at a time. At the end, the
    best is measured again in turns with the default, because a machine is not equally fast all the time.

    run: returns for given settings a function that runs the network once on a fixed input; either may raise. rounding:
    also try settings that round differently, and accept outputs that differ by that.
    """
    agree = _agree if rounding else _are_equal
    usual = untuned(threads)
    best, expected = _timed(run, usual, None, agree)
    yield best
    exact, others = (_other_threads, _no_arena), (_other_providers, _other_levels)
    for vary in (*others, *exact) if rounding else exact:
        for way in vary(best.way):
            trial, _ = _timed(run, way, expected, agree)
            yield trial
            if trial.best_ms is not None and best.best_ms is not None and trial.best_ms < _WORTH * best.best_ms:
                best = trial
    if best.way != usual:
        yield from _in_turns(run, (usual, best.way))


def fastest(trials: Sequence[Trial]) -> Trial:
    """The trial to keep: the first one that no later one beats by more than the noise."""
    best, *others = _comparable(trials)
    for each in others:
        if each.best_ms is not None and best.best_ms is not None and each.best_ms < _WORTH * best.best_ms:
            best = each
    return best


def _comparable(trials: Sequence[Trial]) -> Sequence[Trial]:
    """The trials that decide, the default first: the two that were measured in turns if there are such."""
    was_in_turns = len(trials) > 2 and trials[-2].way == trials[0].way
    return trials[-2:] if was_in_turns else trials


def keep_fastest(path: Path, trials: Sequence[Trial]) -> Trial:
    """Use the fastest trial's settings for this file's network from now on; returns it. OSError if the store cannot be
    written."""
    usual, best = _comparable(trials)[0], fastest(trials)
    known = usual.best_ms is not None and best.best_ms is not None
    keep(path, best.way, Gain(usual.best_ms or 0.0, best.best_ms or 0.0) if known else None)
    return best


def _in_turns(
    run: Callable[[RunSettings], Callable[[], Sequence[F32]]], ways: Sequence[RunSettings]
) -> Iterator[Trial]:
    """Settings that are known to work, measured alternately."""
    opened = [run(way) for way in ways]
    taken: list[list[float]] = [[] for _ in ways]
    for turn in range(1 + _ROUNDS_IN_TURNS):
        for once, spent in zip(opened, taken, strict=True):
            start = perf_counter()
            once()
            if turn > 0:  # the first run allocates
                spent.append(perf_counter() - start)
    yield from (Trial(way, min(spent) * 1e3) for way, spent in zip(ways, taken, strict=True))


def _timed(
    run: Callable[[RunSettings], Callable[[], Sequence[F32]]],
    way: RunSettings,
    expected: Sequence[F32] | None,
    agree: Callable[[Sequence[F32], Sequence[F32]], bool],
) -> tuple[Trial, Sequence[F32]]:
    try:
        once = run(way)
        outputs = once()
        if expected is not None and not agree(outputs, expected):
            return Trial(way, None, "its outputs differ"), outputs
        taken = []
        for _ in range(_ROUNDS):
            start = perf_counter()
            once()
            taken.append(perf_counter() - start)
    except Exception as error:  # onnxruntime has an error class for each status code, without a common base
        if expected is None:
            raise
        return Trial(way, None, (str(error).splitlines() or ["no reason given"])[0]), ()
    return Trial(way, min(taken) * 1e3), outputs


def _are_equal(ours: Sequence[F32], theirs: Sequence[F32]) -> bool:
    """Whether outputs are equal bit by bit. One input decides: another order of summation shows in some of the many
    thousand numbers."""
    return [a.tobytes() for a in ours] == [b.tobytes() for b in theirs]


def _agree(ours: Sequence[F32], theirs: Sequence[F32]) -> bool:
    if len(ours) != len(theirs):
        return False
    return all(
        a.shape == b.shape and bool(np.all(np.abs(a - b) <= _AGREE * max(1e-6, float(np.abs(b).max(initial=0.0)))))
        for a, b in zip(ours, theirs, strict=True)
    )


def _other_providers(way: RunSettings) -> Iterator[RunSettings]:
    there = [name for name in PROVIDERS if name in ort.get_available_providers()]
    for place, name in enumerate(there):
        if name != way.providers[0]:
            yield evolve(way, providers=tuple(there[place:]))


def _other_threads(way: RunSettings) -> Iterator[RunSettings]:
    cores = os.cpu_count() or 1
    yield from (evolve(way, threads=n) for n in (1, 2, 4, cores) if n <= cores and n != way.threads)


def _other_levels(way: RunSettings) -> Iterator[RunSettings]:
    yield from (evolve(way, optimisation=level) for level in ("ORT_ENABLE_EXTENDED", "ORT_ENABLE_BASIC"))


def _no_arena(way: RunSettings) -> Iterator[RunSettings]:
    yield evolve(way, arena=False)


def settings_file() -> Path:
    """The file of the stored settings; it need not exist. ModelError if it cannot exist."""
    return store() / "tuning.json"


def _read(file: Path) -> dict[str, dict[str, Any]]:
    """The stored settings; empty if the file is missing or damaged: then networks run untuned."""
    try:
        rows = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {key: row for key, row in rows.items() if isinstance(row, dict)} if isinstance(rows, dict) else {}


def _key(path: Path) -> str:
    machine = hashlib.sha256(f"{_processor()} {os.cpu_count()}".encode()).hexdigest()[:12]
    return f"{file_sha256(path)[:16]} {machine} {ort.__version__}"


def _processor() -> str:
    """Model name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


def _short(provider: str) -> str:
    return provider.removesuffix("ExecutionProvider")
