"""Parameter sweeps: which sets to try, and which of those are best.

A sweep asks a ``Proposer`` for one set after another, and tells it the scores of all earlier ones."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import parse_yaml
from pipeline.params import ParamsError

MOST_POINTS = 1000
"""Sets of parameters that a sweep may try."""


@dataclass(frozen=True)
class Axis:
    """One parameter and its values."""

    name: str
    """Such as ``cluster.tolerance_m``."""
    values: tuple[Any, ...]
    """Those that a grid takes."""
    low: float | None = None
    """Lower end of a range, in the parameter's unit; None for a list of values."""
    high: float | None = None
    """Upper end, which a grid includes; None for a list of values."""
    is_whole: bool = False
    """Whether values are integers."""

    def of_type(self, current: Any) -> Axis:
        """The same for a parameter whose value is now ``current``: of whole numbers if that is one."""
        if self.low is None or isinstance(current, bool) or not isinstance(current, int):
            return self
        values = sorted({round(value) for value in self.values})
        return replace(self, values=tuple(values), is_whole=True)


def parse_axis(text: str) -> Axis:
    """``NAME=a,b,c``, or ``NAME=low:high:count``. BadInput for anything else."""
    name, separator, values = text.partition("=")
    if not separator or not name or not values:
        raise BadInput(f"--over {text}: expected NAME=VALUE,VALUE,… or NAME=LOW:HIGH:COUNT")
    parts = values.split(":")
    if len(parts) == 1:
        return Axis(name, tuple(parse_yaml(value, f"--over {text}", ParamsError) for value in values.split(",")))
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise BadInput(f"--over {text}: expected NAME=LOW:HIGH:COUNT, three numbers") from None
    if len(parts) != 3 or not low < high or not 2 <= count <= MOST_POINTS:
        raise BadInput(f"--over {text}: expected LOW below HIGH, and a COUNT of 2 to {MOST_POINTS}")
    return Axis(name, tuple(round(float(value), 6) for value in np.linspace(low, high, count)), low, high)


def grid(axes: Sequence[Axis]) -> list[dict[str, Any]]:
    """Every combination. BadInput for too many."""
    count = int(np.prod([len(axis.values) for axis in axes]))
    if count > MOST_POINTS:
        raise BadInput(f"the grid has {count} points, more than {MOST_POINTS}; use fewer values, or --latin N")
    names = [axis.name for axis in axes]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*(axis.values for axis in axes))]


def latin(axes: Sequence[Axis], count: int, seed: int = 0) -> list[dict[str, Any]]:
    """``count`` combinations with each parameter spread evenly (Latin hypercube): any value of a range, each value of
    a list about equally often. The same seed gives the same combinations."""
    from scipy.stats.qmc import LatinHypercube  # takes half a second to import

    shares = LatinHypercube(len(axes), rng=np.random.default_rng(seed)).random(count)
    return [{axis.name: _at(axis, float(share)) for axis, share in zip(axes, row, strict=True)} for row in shares]


def _at(axis: Axis, share: float) -> Any:
    if axis.low is None or axis.high is None:
        return axis.values[min(int(share * len(axis.values)), len(axis.values) - 1)]
    if axis.is_whole:
        low, high = axis.values[0], axis.values[-1]
        return low + min(int(share * (high - low + 1)), high - low)
    return round(axis.low + share * (axis.high - axis.low), 6)


@dataclass(frozen=True)
class Tried:
    """One set of parameters and its scores."""

    run: str
    """Name of the run."""
    changes: Mapping[str, Any]
    """Parameter → value."""
    missed: float | None
    """Missed leads; less is better."""
    phantoms: float | None
    """Phantom leads; less is better."""


Proposer = Callable[[Sequence[Tried]], Mapping[str, Any] | None]
"""The next set to try after those that were tried, in order; None at the end."""


def fixed(sets: Sequence[Mapping[str, Any]]) -> Proposer:
    """These sets, whatever their scores."""
    return lambda tried: sets[len(tried)] if len(tried) < len(sets) else None


def searching(axes: Sequence[Axis], count: int, seed: int = 0) -> Proposer:
    """``count`` sets, each chosen by the scores of all before: optuna's tree-structured Parzen estimator for several
    objectives (Bergstra et al. 2011, Ozaki et al. 2022), after ten random ones. The same seed and scores give the
    same sets. Raises BadInput if optuna is not installed.
    """
    try:
        import optuna  # takes a second to import
    except ImportError:
        raise BadInput("--search needs optuna; `make install` installs it with the extra `fleet`") from None
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(directions=["minimize"] * 2, sampler=optuna.samplers.TPESampler(seed=seed))
    asked: list[Any] = []

    def propose(tried: Sequence[Tried]) -> Mapping[str, Any] | None:
        if asked:
            missed, phantoms = tried[-1].missed, tried[-1].phantoms
            if missed is None or phantoms is None:
                study.tell(asked[-1], state=optuna.trial.TrialState.FAIL)
            else:
                study.tell(asked[-1], (missed, phantoms))
        if len(tried) == count:
            return None
        asked.append(study.ask())
        return {axis.name: _suggested(asked[-1], axis) for axis in axes}

    return propose


def _suggested(trial: Any, axis: Axis) -> Any:
    if axis.low is None or axis.high is None:
        return axis.values[trial.suggest_categorical(axis.name, range(len(axis.values)))]
    if axis.is_whole:
        return trial.suggest_int(axis.name, axis.values[0], axis.values[-1])
    return round(trial.suggest_float(axis.name, axis.low, axis.high), 6)


def front(tried: Sequence[Tried]) -> list[Tried]:
    """The Pareto front: sets that no other set beats in one score without losing in the other, ordered by the first
    score. Of equal sets, one."""
    known = [each for each in tried if each.missed is not None and each.phantoms is not None]
    best: list[Tried] = []
    for each in sorted(known, key=lambda one: (one.missed, one.phantoms, one.run)):
        if not best or each.phantoms < best[-1].phantoms:  # type: ignore[operator]
            best.append(each)
    return best


def points_of(tried: Sequence[Tried]) -> list[tuple[float, float]]:
    """Phantom leads and missed leads of each set that has both."""
    return [(each.phantoms, each.missed) for each in tried if each.missed is not None and each.phantoms is not None]


def best_of(tried: Sequence[Tried]) -> Tried | None:
    """The set of the front with the smallest sum of both scores; None if no set has both."""
    return min(front(tried), key=lambda one: (one.missed or 0.0) + (one.phantoms or 0.0), default=None)
