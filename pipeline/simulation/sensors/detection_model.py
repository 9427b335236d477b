"""Simulated detections in a scenario's images, without a network: the ``detections`` part of a scenario file. True
boxes and lane lines with a detector's errors (``truth_boxes``, ``truth_lanes``)."""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.world.roads import ScenarioPart


class BoxNoise(ScenarioPart):
    """A detector's errors. The defaults are near what the embedded detector does on drawn images (six scenarios, 500
    clear vehicles): box heights 6 % off to 40 m and 7 % beyond, 1.5 px at least; 2 % missed to 80 m, half beyond 105 m.
    The reach is set shorter, as real images' is."""

    lasting_share: float = Field(default=0.03, ge=0.0, le=1.0)
    """Standard deviation of each edge as a share of the box's height, once per vehicle."""
    frame_share: float = Field(default=0.03, ge=0.0, le=1.0)
    """The same, once per frame."""
    edge_px: float = Field(default=0.7, ge=0.0, le=100.0)
    """Least standard deviation of an edge."""
    missed: float = Field(default=0.02, ge=0.0, le=1.0)
    """Share of clear, near vehicles missed per frame."""
    reach_m: float = Field(default=85.0, ge=0.0, le=10_000.0)
    """Distance at which half are missed."""
    fall_off_m: float = Field(default=6.0, gt=0.0, le=1000.0)
    """Width of the transition around ``reach_m``."""
    visible_share: float = Field(default=0.35, ge=0.0, le=1.0)
    """Vehicles less visible than this are not found."""


class LineNoise(ScenarioPart):
    """A lane detector's errors."""

    sigma_px: float = Field(default=1.5, ge=0.0, le=100.0)
    """Standard deviation of a point across the line."""
    missed: float = Field(default=0.3, ge=0.0, le=1.0)
    """Share of points missed per frame."""
    reach_m: float = Field(default=55.0, gt=5.0, le=1000.0)
    """No paint is seen beyond it."""


class Detections(ScenarioPart):
    """Vehicles and lane lines, with their errors."""

    measured: bool = False
    """Instead of ``boxes``, those with the errors measured of a detector of real images (``real_detector``), false ones
    among them."""
    boxes: BoxNoise | None = None
    """None: vehicles are not looked for."""
    lines: LineNoise | None = None
    """None: lane lines are not looked for."""
