"""What is found in the pictures of a scenario without a network looking at them: the ``detections`` part of a scenario
file. True boxes and true lane lines, with a detector's errors (``truth_boxes``, ``truth_lanes``)."""

from __future__ import annotations

from pydantic import Field

from pipeline.simulation.world.roads import Strict


class BoxNoise(Strict):
    """A detector's errors. lasting_share, frame_share: standard deviation of each edge, as a share of the box's height,
    that stays with a vehicle and that is new in each frame. edge_px: of each edge, never less. missed: share of clear
    and near vehicles that a frame misses. reach_m, fall_off_m: where half are missed, and over how many metres that
    comes. visible_share: less of a vehicle than this is not found.

    The defaults are near what the embedded detector does on drawn pictures (six scenarios, 500 clear vehicles): box
    heights 6 % off to 40 m and 7 % beyond, 1.5 px at least; 2 % missed to 80 m, half beyond 105 m. The reach is set
    shorter, as real pictures' is.
    """

    lasting_share: float = Field(default=0.03, ge=0.0, le=1.0)
    frame_share: float = Field(default=0.03, ge=0.0, le=1.0)
    edge_px: float = Field(default=0.7, ge=0.0, le=100.0)
    missed: float = Field(default=0.02, ge=0.0, le=1.0)
    reach_m: float = Field(default=85.0, ge=0.0, le=10_000.0)
    fall_off_m: float = Field(default=6.0, gt=0.0, le=1000.0)
    visible_share: float = Field(default=0.35, ge=0.0, le=1.0)


class LineNoise(Strict):
    """sigma_px: of a point, across. missed: share of points that a frame lacks. reach_m: no paint is seen beyond."""

    sigma_px: float = Field(default=1.5, ge=0.0, le=100.0)
    missed: float = Field(default=0.3, ge=0.0, le=1.0)
    reach_m: float = Field(default=55.0, gt=5.0, le=1000.0)


class Detections(Strict):
    """Vehicles and lane lines, with their errors; None: none are looked for. measured: instead of ``boxes``, those with
    the errors measured of a detector of real pictures (``real_detector``), false ones among them."""

    measured: bool = False
    boxes: BoxNoise | None = None
    lines: LineNoise | None = None
