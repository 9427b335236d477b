"""Shared by all heads: how a network takes its image, which of its outputs contains the lines, and their points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from pipeline.types import F32, F64, I32

InputFit = Literal["stretch", "letterbox", "lower"]
"""How an image is fitted to the input: stretched; scaled as a whole, with grey borders; its lower part, with the
input's aspect ratio."""
PerChannel = tuple[float, float, float]
IMAGENET: tuple[PerChannel, PerChannel] = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
"""Mean and standard deviation of the images that most networks were pretrained on."""
_THERE = 0.5
"""Minimum probability of a line."""


class UnknownLaneHead(ValueError):
    """Outputs that no head recognises; the text describes them."""


@dataclass(frozen=True, eq=False)
class Points:
    """Points on painted lines and on the edges of the road."""

    uv: F64
    """(M, 2) as fractions of the network's input, 0–1 from its left and upper edge."""
    score: F32
    """(M,) 0–1."""
    line: I32
    """(M,) line of each point, as in ``RawLanes``."""


class LaneOutputs(NamedTuple):
    """Properties of a network's outputs, used to recognise its head."""

    shapes: Sequence[tuple[int, ...]]
    """Shape of each output, in the network's order."""
    names: Sequence[str]
    """Name of each output in the file."""

    def only_map(self) -> int | None:
        """The index of the only output that is a map, (1, channels, rows, columns); None if there are none or
        several."""
        maps = [i for i, shape in enumerate(self.shapes) if len(shape) == 4 and shape[0] == 1]
        return maps[0] if len(maps) == 1 else None


@dataclass(frozen=True)
class LaneHead:
    """How one family of networks expects its image (RGB), and how its outputs are decoded."""

    name: str
    """Display name."""
    output: int
    """Index of the output with the lines."""
    read: Callable[[F32], Points]
    """Decodes that output, without its batch axis, to points."""
    fit: InputFit = "stretch"
    """How the image is fitted to the network's input size."""
    exists: int | None = None
    """Index of the output with the probability that each line exists; None without one."""
    mean: PerChannel = (0.0, 0.0, 0.0)
    """Subtracted from the image, scaled to 0–1."""
    spread: PerChannel = (1.0, 1.0, 1.0)
    """Divisor of the difference."""
    horizon: float | None = None
    """Row of the horizon in the input, as a share of its height: as much sky is cut off an image. None: none is."""
    road: int | None = None
    """Index of the output with the drivable area; None without one."""
    read_road: Callable[[F32], Points] | None = None
    """Decodes that output to points on the edges of the area."""
    keeps_aspect: bool = False
    """Whether the network is fully convolutional, and its input is given as many rows as the image without that sky has
    at its number of columns. Otherwise, its input keeps its size."""

    def points(self, outputs: Sequence[F32]) -> Points:
        """Points on lines from the network's outputs."""
        found = self.read(np.asarray(outputs[self.output][0], np.float32))
        if self.road is not None and self.read_road is not None:
            edges = self.read_road(np.asarray(outputs[self.road][0], np.float32))
            found = Points(
                np.concatenate([found.uv, edges.uv]),
                np.concatenate([found.score, edges.score]),
                np.concatenate([found.line, edges.line]),
            )
        if self.exists is None:
            return found
        there = np.asarray(outputs[self.exists]).ravel()[found.line] > _THERE
        return Points(found.uv[there], found.score[there], found.line[there])
