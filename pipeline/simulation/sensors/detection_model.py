"""Simulated detections in a scenario's images, without a network: the ``detections`` part of a scenario file. True
boxes and lane lines with a detector's errors (``truth_boxes``, ``truth_lanes``)."""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.world.roads import Strict


class BoxNoise(Strict):
    """A detector's errors. lasting_share, frame_share: standard deviation of each edge as a share of the box's height,
    once per vehicle and once per frame. edge_px: least standard deviation of an edge. missed: share of clear, near
    vehicles missed per frame. reach_m, fall_off_m: distance at which half are missed, and width of that transition.
    visible_share: vehicles less visible than this are not found.

    The defaults are near what the embedded detector does on drawn images (six scenarios, 500 clear vehicles): box
    heights 6 % off to 40 m and 7 % beyond, 1.5 px at least; 2 % missed to 80 m, half beyond 105 m. The reach is set
    shorter, as real images' is.
    """

    lasting_share: float = Field(default=0.03, ge=0.0, le=1.0)
    frame_share: float = Field(default=0.03, ge=0.0, le=1.0)
    edge_px: float = Field(default=0.7, ge=0.0, le=100.0)
    missed: float = Field(default=0.02, ge=0.0, le=1.0)
    reach_m: float = Field(default=85.0, ge=0.0, le=10_000.0)
    fall_off_m: float = Field(default=6.0, gt=0.0, le=1000.0)
    visible_share: float = Field(default=0.35, ge=0.0, le=1.0)


class LineNoise(Strict):
    """sigma_px: standard deviation of a point across the line. missed: share of points missed per frame. reach_m: no
    paint is seen beyond it."""

    sigma_px: float = Field(default=1.5, ge=0.0, le=100.0)
    missed: float = Field(default=0.3, ge=0.0, le=1.0)
    reach_m: float = Field(default=55.0, gt=5.0, le=1000.0)


class Detections(Strict):
    """Vehicles and lane lines, with their errors; None: none are looked for. measured: instead of ``boxes``, those with
    the errors measured of a detector of real images (``real_detector``), false ones among them."""

    measured: bool = False
    boxes: BoxNoise | None = None
    lines: LineNoise | None = None
