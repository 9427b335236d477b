"""Shared by all heads: how a network takes its image, which of its outputs contains the lines, and their points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from pipeline.types import F32, F64, I32

InputFit = Literal["stretch", "letterbox", "lower"]
"""How an image is fitted to the input: stretched; scaled whole onto grey; its lower part, in the input's aspect."""
PerChannel = tuple[float, float, float]
IMAGENET: tuple[PerChannel, PerChannel] = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Mean and spread of the images that most networks were first trained on."""
_THERE = 0.5
"""A line is there when its probability is higher."""


class UnknownLaneHead(ValueError):
    """Outputs that no head recognises; the text says what they are."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points on painted lines."""

    uv: F64
    """(M, 2) in shares of the network's input, 0–1 from its left and upper edge."""
    score: F32
    """(M,) 0–1."""
    line: I32
    """(M,) which line each is of; −1 where the network does not say."""


class LaneOutputs(NamedTuple):
    """The outputs of a network, to recognise its head by."""

    shapes: Sequence[tuple[int, ...]]
    """Of each output, in the network's order."""
    names: Sequence[str]
    """Of each output, as the file has them."""

    def only_map(self) -> int | None:
        """The index of the one output that is a map, (1, channels, rows, columns); None when there are none or more."""
        maps = [i for i, shape in enumerate(self.shapes) if len(shape) == 4 and shape[0] == 1]
        return maps[0] if len(maps) == 1 else None


@dataclass(frozen=True)
class LaneHead:
    """How one family of networks takes its image (RGB), and how its answer is read."""

    name: str
    """For people."""
    output: int
    """Which output holds the lines."""
    read: Callable[[F32], Points]
    """That output without its batch axis → points."""
    fit: InputFit = "stretch"
    """How the image is brought to the network's input size."""
    exists: int | None = None
    """Which output holds the probability that each line is there; None: no output does."""
    mean: PerChannel = (0.0, 0.0, 0.0)
    """Taken from the image's 0–1."""
    spread: PerChannel = (1.0, 1.0, 1.0)
    """What the difference is divided by."""
    horizon: float | None = None
    """Where its training images had the horizon, as a share of their height: so much sky is cut off that the input
    has it there too. None: it does not care."""

    def points(self, outputs: Sequence[F32]) -> Points:
        """The points on lines in the network's answer."""
        found = self.read(np.asarray(outputs[self.output][0], np.float32))
        if self.exists is None:
            return found
        there = np.asarray(outputs[self.exists]).ravel()[found.line] > _THERE
        return Points(found.uv[there], found.score[there], found.line[there])
