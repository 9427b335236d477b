"""The measured errors of a detector on real images: the type of ``measured_noise.json``, which holds every number and
the data it was measured on. ``python -m pipeline.experiments.robustness.measure`` writes the file."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import Field

from pipeline.simulation.world.roads import ScenarioPart

FILE = Path(__file__).with_suffix(".json")
SHARES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Probabilities of the values in each list of quantiles."""


class FalseBoxes(ScenarioPart):
    """Boxes of vehicles where none is labelled."""

    per_frame: float = Field(ge=0.0)
    """Mean number per frame."""
    lasts: float = Field(ge=0.0, le=1.0)
    """Share that is also in the next frame, 0.1 s later."""
    seen: tuple[tuple[float, float, float, float], ...]
    """All observed false boxes: height in px at a focal length of 907 px, width over height, bearing in degrees to
    either side, and score."""
    height_share: float = Field(ge=0.0)
    """Standard deviation of ln height from frame to frame, for those that persist."""


class MeasuredNoise(ScenarioPart):
    """Lists by range have one value per bin between two values of ``ranges_m``; beyond the last, the last bin is
    used."""

    measured_on: tuple[str, ...]
    """Recordings and their labels, and the network."""
    ranges_m: tuple[float, ...]
    """Edges of the range bins, from the lower edge of the first to the upper edge of the last."""
    vehicles: tuple[int, ...]
    """Number of labelled, unoccluded vehicles in each bin."""
    visible: tuple[float, ...]
    """Edges of the bins of a vehicle's visible share, descending."""
    found: tuple[tuple[float, ...], ...]
    """Share detected, by bin of visible share and by range."""
    missed_again: float = Field(ge=0.0, le=0.99)
    """Correlation between frames 0.1 s apart of the variable that decides whether a vehicle is missed: misses come in
    bursts."""
    across_share: float = Field(ge=0.0)
    """Standard deviation of the left and right edge, share of the box's height: the part that lasts."""
    up_share: float = Field(ge=0.0)
    """The same of the upper and lower edge."""
    wanders: float = Field(ge=0.0, le=1.0)
    """Share of the variance of these two that changes within seconds; the rest is constant for a vehicle."""
    frame_share: float = Field(ge=0.0)
    """Of each edge, share of the height, new in each frame."""
    frame_px: float = Field(ge=0.0)
    """The minimum of that, at a focal length of 907 px."""
    hidden_cut: float = Field(ge=0.0, le=1.0)
    """By which share of a strip that nearer vehicles hide a box is smaller: 0 where boxes show the whole vehicle, 1
    where they show the visible part. Nearer vehicles do not fill their boxes, so even the latter gives less than 1."""
    score: tuple[tuple[float, ...], ...]
    """Quantiles of the scores of detected vehicles, by range."""
    car_called: dict[str, float]
    """Share of cars detected as another class, by name."""
    large_called: dict[str, float]
    """The same of trucks and buses."""
    doubled: float = Field(ge=0.0, le=1.0)
    """Share of detected vehicles with a second box."""
    false_boxes: FalseBoxes
    """Frequency, position and size of false boxes."""


@cache
def measured() -> MeasuredNoise:
    """The measured values."""
    return MeasuredNoise.model_validate_json(FILE.read_text(encoding="utf-8"))
