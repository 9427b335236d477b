"""Which name tags of the 3D view have room.

Of tags that would cover each other, the one of the lowest rank is shown, and of the same rank the one nearest to the
camera. The others show their number alone, if there is room for that, or nothing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import viser.transforms

from pipeline.types import F64, Point3

_CHARACTER_PX, _LINE_PX = 4.6, 13.0
"""Width of an average character and height of a tag at scale 1, as the browser draws them, with their border."""
_BORDER_PX = 5.0
"""Left and right of the text together."""


class NameTag(NamedTuple):
    """A name tag above an object or a label."""

    text: str
    """Number, class, and distance or state."""
    number: str
    """Shown instead where the text has no room."""
    at: Point3
    """Middle of its lower edge, ego frame."""
    rank: int
    """Tags of a lower rank come first."""
    scale: float
    """Of its size."""


@dataclass(frozen=True)
class ViewCamera:
    """The camera of one browser."""

    position: F64
    """(3,) ego frame."""
    wxyz: F64
    """(4,) its rotation; it looks along its z axis, y down."""
    fov_rad: float
    """Vertical field of view."""
    width_px: float
    """Width of the view."""
    height_px: float
    """Height of the view."""


def arranged(tags: Sequence[NameTag], camera: ViewCamera) -> list[str]:
    """The text of each tag, so that none covers another; empty for those without room or out of sight."""
    out = [""] * len(tags)
    if not tags or camera.height_px <= 0:
        return out
    turn = viser.transforms.SO3(camera.wxyz).as_matrix()
    seen = (np.array([tag.at for tag in tags], dtype=float) - camera.position) @ turn
    focal_px = camera.height_px / 2 / math.tan(camera.fov_rad / 2)
    taken: list[tuple[float, float, float, float]] = []
    for place in sorted(range(len(tags)), key=lambda each: (tags[each].rank, seen[each, 2])):
        x, y, away_m = seen[place]
        if away_m <= 0:
            continue
        u, v = camera.width_px / 2 + focal_px * x / away_m, camera.height_px / 2 + focal_px * y / away_m
        if not (0 <= u <= camera.width_px and 0 <= v <= camera.height_px):
            continue
        tag = tags[place]
        for text in (tag.text, tag.number):
            half = (len(text) * _CHARACTER_PX + _BORDER_PX) * tag.scale / 2
            box = (u - half, v - _LINE_PX * tag.scale, u + half, v)
            if not any(_overlap(box, other) for other in taken):
                taken.append(box)
                out[place] = text
                break
    return out


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
