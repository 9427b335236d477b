"""The roads and the traffic of the experiment ``iso``: a lead ahead in the lane, and what it does."""

from __future__ import annotations

from math import sqrt
from typing import Any, Literal

from pipeline.experiments.straight_track import LANE, TARGET, car
from pipeline.simulation.scenario import Scenario

IsoTest = Literal["acquisition", "discrimination", "curve", "stop", "following"]
LEAD_BRAKE_MPS2 = 2.5
RADII_M = (500.0, 250.0, 125.0)
CURVE_LATERAL_MPS2 = 2.0
BEND_FROM_M = 210.0
"""Beyond this, the radius of a curve is constant."""
_TRANSITION_M = 30.0
_LANE_WIDTH_M = 3.5


def scenario(test: IsoTest, value: float, seed: int) -> Scenario:
    """The scenario of one test. value: radius in metres (curve), or speed in km/h (all others). The lead is
    ``TARGET``."""
    speed = sqrt(CURVE_LATERAL_MPS2 * value) if test == "curve" else value / 3.6
    leads, duration_s = _traffic(test, speed)
    bend = [
        {"length_m": BEND_FROM_M - _TRANSITION_M},
        {"length_m": _TRANSITION_M, "end_curvature_per_m": 1.0 / value},
        {"length_m": 2000.0, "radius_m": value},
    ]
    return Scenario.model_validate(
        {
            "title": f"{test} {value:g}",
            "seed": seed,
            "duration_s": duration_s,
            "road": {
                "segments": bend if test == "curve" else [{"length_m": 5000.0}],
                "lanes_oncoming": 0,
                "lane_width_m": _LANE_WIDTH_M,
            },
            "ego": {"lane": LANE, "speed_mps": {0.0: speed}},
            "actors": leads,
        }
    )


def _traffic(test: IsoTest, speed_mps: float) -> tuple[list[dict[str, Any]], float]:
    """The vehicles, the lead first, and the length of the drive in seconds. A lead at the ego vehicle's speed starts at
    the distance that ACC keeps: 5 m and 1.8 s ahead (``acc.min_gap_m``, ``acc.time_gap_s``)."""
    steady, gap_m = {0.0: speed_mps}, 5.0 + 1.8 * speed_mps
    match test:
        case "acquisition":
            return [car(TARGET, LANE, 130.0, {0.0: 0.5 * speed_mps})], 18.0
        case "discrimination":
            beside = [car(2, LANE + 1, gap_m - 8.0, steady), car(3, LANE - 1, gap_m - 4.0, steady)]
            return [car(TARGET, LANE, gap_m, steady), *beside], 12.0
        case "curve":
            slows = {0.0: speed_mps, 9.0: speed_mps, 11.0: 0.8 * speed_mps}
            return [car(TARGET, LANE, gap_m, slows)], 16.0
        case "stop":
            brake = {"at_s": 4.0, "decel_mps2": LEAD_BRAKE_MPS2}
            return [{**car(TARGET, LANE, gap_m, steady), "brake": brake}], 22.0
        case "following":
            waves = {0.0: 0.75 * speed_mps, 14.0: 0.75 * speed_mps, 18.0: 0.6 * speed_mps, 24.0: 0.8 * speed_mps}
            return [car(TARGET, LANE, 70.0, waves)], 32.0
