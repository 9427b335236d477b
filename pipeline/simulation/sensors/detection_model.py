"""Simulated detections in a scenario's images, without a network: the ``detections`` part of a scenario file. True
boxes and lane lines with a detector's errors (``truth_boxes``, ``truth_lanes``)."""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.world.roads import ScenarioPart


class BoxNoise(ScenarioPart):
    """A detector's errors. The defaults approximate those of the embedded detector on rendered images (six scenarios,
    500 clearly visible vehicles): box height errors of 6 % up to 40 m and 7 % beyond, at least 1.5 px; 2 % missed up to
    80 m, half beyond 105 m. The default reach is shorter, like that on real images."""

    lasting_share: float = Field(default=0.03, ge=0.0, le=1.0)
    """Standard deviation of each edge as a share of the box's height, once per vehicle."""
    frame_share: float = Field(default=0.03, ge=0.0, le=1.0)
    """The same, once per frame."""
    edge_px: float = Field(default=0.7, ge=0.0, le=100.0)
    """Minimum standard deviation of an edge."""
    missed: float = Field(default=0.02, ge=0.0, le=1.0)
    """Share of clearly visible, near vehicles missed per frame."""
    reach_m: float = Field(default=85.0, ge=0.0, le=10_000.0)
    """Distance at which half are missed."""
    fall_off_m: float = Field(default=6.0, gt=0.0, le=1000.0)
    """Width of the transition around ``reach_m``."""
    visible_share: float = Field(default=0.35, ge=0.0, le=1.0)
    """Vehicles with a smaller visible share are not detected."""


class LineNoise(ScenarioPart):
    """A lane detector's errors."""

    sigma_px: float = Field(default=1.5, ge=0.0, le=100.0)
    """Standard deviation of a point across the line."""
    missed: float = Field(default=0.3, ge=0.0, le=1.0)
    """Share of points missed per frame."""
    reach_m: float = Field(default=55.0, gt=5.0, le=1000.0)
    """Beyond this distance, no paint is detected."""


class Detections(ScenarioPart):
    """Vehicles and lane lines, with their errors."""

    measured: bool = False
    """Instead of ``boxes``, use the errors measured for a detector of real images (``real_detector``), including false
    boxes."""
    boxes: BoxNoise | None = None
    """None: vehicles are not detected."""
    lines: LineNoise | None = None
    """None: lane lines are not detected."""
