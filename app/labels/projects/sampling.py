"""Chooses which frames of a project's recordings are to be labelled."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field, model_validator

from app.labels.acts.request_fields import Strict

APART_NS = 1_000_000_000
"""By worth, frames of one recording are at least this far apart: frames nearer than that show nearly the same."""


class Sampling(Strict):
    """Exactly one rule. The seed is only for ``random``."""

    every_s: float | None = Field(None, gt=0, le=86_400)
    """A frame every so many seconds of each recording."""
    random: int | None = Field(None, ge=1, le=1_000_000)
    """So many frames of all recordings, each with the same probability."""
    seed: int = Field(0, ge=0, le=2**63 - 1)
    """The same seed chooses the same frames."""
    worth: int | None = Field(None, ge=1, le=1_000_000)
    """So many frames of all recordings, those with the most uncertain proposals and leads."""

    @model_validator(mode="after")
    def _one_rule(self) -> Sampling:
        if sum(each is not None for each in (self.every_s, self.random, self.worth)) != 1:
            raise ValueError("give one of every_s, random and worth")
        return self

    @property
    def text(self) -> str:
        """The rule in a few words, as the queue shows it."""
        if self.every_s is not None:
            return f"one frame every {self.every_s:g} s"
        if self.random is not None:
            return f"{self.random} random frames, seed {self.seed}"
        return f"the {self.worth} frames worth most"


@dataclass(frozen=True)
class SampledDrive:
    """A recording to choose from."""

    key: str
    """Derived from its content."""
    t_ns: Sequence[int]
    """Ticks of its frames, ascending."""
    worth: Mapping[int, float]
    """Expected value of a label by frame; other frames are worth nothing."""


def sample(rule: Sampling, drives: Sequence[SampledDrive]) -> dict[str, list[int]]:
    """The chosen frames of each recording, ascending, by its key. The order of the recordings does not matter."""
    ordered = sorted(drives, key=lambda each: each.key)
    if rule.every_s is not None:
        return {each.key: _every(each.t_ns, round(rule.every_s * 1e9)) for each in ordered}
    frames = [(each.key, frame) for each in ordered for frame in range(len(each.t_ns))]
    if rule.random is not None:
        chosen = np.random.default_rng(rule.seed).permutation(len(frames))[: rule.random]
        return _by_key(ordered, [frames[number] for number in chosen])
    return _by_key(ordered, _worthiest(ordered, rule.worth or 0))


def _every(t_ns: Sequence[int], step_ns: int) -> list[int]:
    """The first frame at or after each step since the first frame; none twice where frames are farther apart."""
    chosen: list[int] = []
    last_step = -1
    for frame, t in enumerate(t_ns):
        step = (t - t_ns[0]) // step_ns
        if step > last_step:
            chosen.append(frame)
            last_step = step
    return chosen


def _worthiest(drives: Sequence[SampledDrive], count: int) -> list[tuple[str, int]]:
    ranked = sorted(
        ((worth, each, frame) for each in drives for frame, worth in each.worth.items() if worth > 0),
        key=lambda found: (-found[0], found[1].key, found[2]),
    )
    chosen: dict[str, list[int]] = {each.key: [] for each in drives}
    found: list[tuple[str, int]] = []
    for _, drive, frame in ranked:
        if len(found) == count:
            break
        if all(abs(drive.t_ns[frame] - drive.t_ns[other]) >= APART_NS for other in chosen[drive.key]):
            chosen[drive.key].append(frame)
            found.append((drive.key, frame))
    return found


def _by_key(drives: Sequence[SampledDrive], chosen: Sequence[tuple[str, int]]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {each.key: [] for each in drives}
    for key, frame in sorted(chosen):
        found[key].append(frame)
    return found
