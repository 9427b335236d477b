"""The colour palette of every view: the meaning of each colour, and its shades for dark and light backgrounds.

LiDAR is magenta and vision cyan, as in the paper's figures; both together are violet, and the closest in-path vehicle
is green.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pipeline.types import FusedObject

Rgb = tuple[int, int, int]
ColorRole = Literal[
    "lidar",
    "vision",
    "fused",
    "cipv",
    "path",
    "ego",
    "ground",
    "unclustered",
    "cluster",
    "dropped",
    "grid",
    "warning",
    "lane",
]


@dataclass(frozen=True)
class Shades:
    """One role's colour as ``#rrggbb`` on a dark and on a light background."""

    dark: str
    """On a dark background."""
    light: str
    """On a light background."""


PALETTE: dict[ColorRole, Shades] = {
    "lidar": Shades("#ff4dd8", "#b8008f"),
    "vision": Shades("#22d3ee", "#0e7490"),
    "fused": Shades("#c4b5fd", "#6d28d9"),
    "cipv": Shades("#4ade80", "#15803d"),
    "path": Shades("#60a5fa", "#1d4ed8"),
    "ego": Shades("#e5e7eb", "#374151"),
    "ground": Shades("#565d6b", "#9ca3af"),
    "unclustered": Shades("#7c7a5e", "#8a8a70"),
    "cluster": Shades("#d6a76c", "#9a6a2f"),
    "dropped": Shades("#3f3f46", "#d4d4d8"),
    "grid": Shades("#33373f", "#d1d5db"),
    "warning": Shades("#fbbf24", "#b45309"),
    "lane": Shades("#fde68a", "#a16207"),
}
"""``cluster`` is a LiDAR cluster without an object; ``dropped`` is a point removed by down-sampling."""


def rgb(role: ColorRole, theme: Literal["dark", "light"] = "dark") -> Rgb:
    """A role's colour as three numbers 0–255."""
    text = getattr(PALETTE[role], theme)
    return int(text[1:3], 16), int(text[3:5], 16), int(text[5:7], 16)


def role_of(each: FusedObject, cipv_id: int | None) -> ColorRole:
    """The colour role of an object: the CIPV, else by the sensors that see it."""
    if each.id == cipv_id:
        return "cipv"
    if each.tracked_by_two_sensors:
        return "fused"
    return "vision" if each.imaged else "lidar"


def shade_of(color: Rgb, identity: int) -> Rgb:
    """The colour, darkened depending on the id, so that neighbours can be distinguished."""
    factor = (1.0, 0.82, 0.91, 0.73)[identity % 4]
    return int(color[0] * factor), int(color[1] * factor), int(color[2] * factor)


def palette_css(theme: Literal["dark", "light"]) -> str:
    """The palette as CSS custom properties, ``--cipv-<role>: #…;``, one per line."""
    return "\n".join(f"--cipv-{role}: {getattr(shades, theme)};" for role, shades in PALETTE.items())
