"""The planned route of a scenario's ego vehicle on the Earth, as given by a map or an earlier drive."""

from __future__ import annotations

import numpy as np

from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors import gnss
from pipeline.simulation.world import world_state
from pipeline.types import Route

SIGMA_M = 0.02
"""Accuracy of a route surveyed with RTK, as in the paper."""
_BEFORE_M, _BEYOND_M, _SPACING_M, _STEP_S = 40.0, 400.0, 2.0, 0.2


def planned_route(scenario: Scenario) -> Route:
    """Along the ego lane from 40 m behind the start to 400 m beyond the script's end, including the script's lane
    changes."""
    alone = scenario.without_others()
    drive = [world_state.at(alone, t) for t in np.arange(0.0, scenario.duration_s + _STEP_S, _STEP_S).tolist()]
    s, d = np.array([[now.s_m, now.d_m] for now in drive]).T
    at = np.arange(s[0] - _BEFORE_M, s[-1] + _BEYOND_M, _SPACING_M)
    forward = np.concatenate([[True], np.diff(np.maximum.accumulate(s)) > 0.0])
    places = scenario.road.to_world(at, np.interp(at, s[forward], d[forward]))
    model = scenario.gnss
    turn = np.radians(90.0 - model.x_axis_deg)
    east = places[:, 0] * np.cos(turn) - places[:, 1] * np.sin(turn)
    north = places[:, 0] * np.sin(turn) + places[:, 1] * np.cos(turn)
    there = np.array(
        [
            gnss.from_local(np.array([e, n, 0.0]), model.lat_deg, model.lon_deg, model.alt_m)
            for e, n in zip(east.tolist(), north.tolist(), strict=True)
        ]
    )
    return Route(f"planned: {scenario.title}", there[:, 0].copy(), there[:, 1].copy(), SIGMA_M)
