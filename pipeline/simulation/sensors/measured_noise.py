"""The measured errors of a detector on real images: the type of ``measured_noise.json``, which holds every number and
the data it was measured on. ``python -m pipeline.experiments.robustness.measure`` writes the file."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from pydantic import Field

from pipeline.simulation.world.roads import ScenarioPart

FILE = Path(__file__).with_suffix(".json")
SHARES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Of which each list of quantiles is."""


class FalseBoxes(ScenarioPart):
    """Boxes of vehicles where none is labelled."""

    per_frame: float = Field(ge=0.0)
    """How many a frame has on average."""
    lasts: float = Field(ge=0.0, le=1.0)
    """Share that the next frame, 0.1 s later, has as well."""
    seen: tuple[tuple[float, float, float, float], ...]
    """Each that was seen: its height in px at a focal length of 907 px, width over height, bearing in degrees to either
    side, and score."""
    height_share: float = Field(ge=0.0)
    """Standard deviation of ln height from frame to frame, of those that last."""


class MeasuredNoise(ScenarioPart):
    """Lists by range have a value for each bin between two of ``ranges_m``; farther than the last: as the last bin."""

    measured_on: tuple[str, ...]
    """Recordings and their labels, and the network."""
    ranges_m: tuple[float, ...]
    """Edges of the bins of range, from the first one's lower to the last one's upper."""
    vehicles: tuple[int, ...]
    """Labelled vehicles in each bin that nothing hides."""
    visible: tuple[float, ...]
    """Edges of the bins of the share of a vehicle in sight, falling."""
    found: tuple[tuple[float, ...], ...]
    """Share found, by bin of what is in sight and by range."""
    missed_again: float = Field(ge=0.0, le=0.99)
    """Correlation, from frame to frame 0.1 s apart, of what decides whether a vehicle is missed: bursts."""
    across_share: float = Field(ge=0.0)
    """Standard deviation of the left and right edge, share of the box's height: the part that lasts."""
    up_share: float = Field(ge=0.0)
    """The same of the upper and lower edge."""
    frame_share: float = Field(ge=0.0)
    """Of each edge, share of the height, new in each frame."""
    frame_px: float = Field(ge=0.0)
    """The least of that, at a focal length of 907 px."""
    score: tuple[tuple[float, ...], ...]
    """Quantiles of the scores of found vehicles, by range."""
    car_called: dict[str, float]
    """Share of cars that is called something else, by name."""
    large_called: dict[str, float]
    """The same of trucks and buses."""
    doubled: float = Field(ge=0.0, le=1.0)
    """Share of found vehicles with a second box of their own."""
    false_boxes: FalseBoxes
    """How often, where and how large they are."""


@cache
def measured() -> MeasuredNoise:
    """What was measured."""
    return MeasuredNoise.model_validate_json(FILE.read_text(encoding="utf-8"))
