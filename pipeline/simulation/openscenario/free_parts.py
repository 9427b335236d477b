"""Entities that do not follow the lanes of the ego vehicle's road, as ``free_actors`` of a scenario."""

from __future__ import annotations

from math import ceil, degrees, hypot, remainder, tau
from typing import Any

import numpy as np

from pipeline.simulation.openscenario.entities import NO_EGO
from pipeline.simulation.openscenario.roads.driven_road import DrivenRoad
from pipeline.simulation.openscenario.storyboard.movers import Mover
from pipeline.simulation.openscenario.storyboard.stage import PlayedScenario

_STEP_S = 0.1
"""Between two speeds of an entity that moves sideways on its road."""


def is_free(mover: Mover, stage: PlayedScenario) -> bool:
    """Whether an entity moves elsewhere than along the lanes of the ego vehicle's road: on a line, on another road, or
    across the road on foot or by bicycle, facing where it goes."""
    is_along = mover.line is None and mover.road is stage.road
    return not is_along or (mover.body.kind in NO_EGO and mover.changes_lanes)


def free_actor(number: int, mover: Mover, road: DrivenRoad, duration_s: float) -> dict[str, Any]:
    """Its keys. road: that of the ego vehicle."""
    line = mover.driven_line(duration_s)
    x, y, heading = line.start
    s_m, d_m = road.project(x, y)
    return {
        "id": number,
        "kind": mover.body.kind,
        "size_m": mover.body.size_m,
        "s_m": s_m,
        "d_m": d_m,
        "heading_deg": degrees(remainder(road.hand * (heading - road.heading(s_m)), tau)),
        "way": [{"length_m": length, "curvature_per_m": road.hand * bend} for length, bend in line.arcs],
        "speed_mps": _speeds(mover, duration_s) if mover.changes_lanes else mover.script.speed_mps,
    }


def _speeds(mover: Mover, duration_s: float) -> dict[float, float]:
    """Speeds over ground, lateral motion included."""
    found = {}
    for t_s in np.linspace(0.0, duration_s, ceil(duration_s / _STEP_S) + 1).tolist():
        _, now = mover.now(t_s)
        found[t_s] = hypot(now.speed_mps, now.d_rate_mps)
    return found
