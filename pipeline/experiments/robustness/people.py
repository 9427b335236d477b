"""People beside the streets of the random traffic.

They walk along the pavement, stand there, or come to the kerb between parked cars and wait until the car has passed.
Nobody enters the lanes, so braking for any of them is a failure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.experiments.robustness.following import STEP_S
from pipeline.types import F64

FIRST_ID = 4000
_SPACING_M = 20.0
"""Mean distance between two people on one side: a shopping street."""
_PAVEMENT_M = (2.5, 4.5)
"""Distance of the pavement from the lanes, behind the parked cars."""
_KERB_M = (0.3, 0.9)
"""Distance from the lanes at which people wait."""
_SPEED_MPS = (0.9, 1.8)
"""Slow to fast walking; 1.3 to 1.5 is comfortable for adults (Bohannon, Age and Ageing 26, 15–19, 1997)."""
_STANDS, _COMES_TO_KERB = 0.3, 0.2
"""Shares of the people."""
_WALKS_S = (5.0, 2.0)
"""Those on the pavement walk from this long before until this long after the car passes: straight on, also where the
road bends."""
_BEFORE_S, _APPROACH_S = (0.5, 4.0), (1.0, 2.5)
"""How long before the car passes they reach the kerb, and how long they walk there."""
_STARTS_S, _STOPS_S = 0.05, 1.0
"""The latter is two steps; nothing shows earlier that they will stop. At urban intersections, even those who stop fast
take two to three, and most take six (Goldhammer et al., Analysis on termination of pedestrians' gait at urban
intersections, ITSC 2014)."""
_PARKED_M, _CROSSING_M = 4.0, 12.0
"""Nobody waits nearer to the middle of a parked car, or stands nearer to a crossing."""


def people(
    rng: np.random.Generator, road: Mapping[str, Any], actors: Sequence[Mapping[str, Any]], way_m: F64, start_m: float
) -> Iterator[dict[str, Any]]:
    """The people of one drive, as free actors.

    Args:
        rng: their own, so that the traffic does not depend on them.
        road: of the scenario.
        actors: of the scenario; the parked ones have a lane and the speed 0.
        way_m: (N,) the ego vehicle's way at each step.
        start_m: where it begins, along the road.
    """
    number, times_s = FIRST_ID, np.arange(len(way_m)) * STEP_S
    crossings = [float(each["s_m"]) for each in road.get("crossings", ())]
    lane_m, middle_m = float(road["lane_width_m"]), float(road["median_m"]) / 2.0
    for side, lanes in ((-1.0, road["lanes_forward"]), (1.0, road["lanes_oncoming"])):
        edge_m = middle_m + lanes * lane_m
        parked = [start_m + each["ahead_m"] for each in actors if each["lane"] * side > 0 and not any(_speeds(each))]
        along_m = start_m + 20.0
        while (along_m := along_m + float(rng.exponential(_SPACING_M))) < start_m + float(way_m[-1]):
            passes_s = float(np.interp(along_m - start_m, way_m, times_s))
            kerb = rng.random() < _COMES_TO_KERB and all(abs(along_m - each) > _PARKED_M for each in parked)
            made = _to_the_kerb(rng, passes_s) if kerb else _on_the_pavement(rng, passes_s)
            if any(abs(along_m - each) < _CROSSING_M for each in crossings):
                continue
            aside_m, turned_deg, speeds = made
            yield {
                "id": number,
                "kind": "pedestrian",
                "s_m": round(along_m, 2),
                "d_m": round(side * (edge_m + aside_m), 2),
                "heading_deg": -side * turned_deg if kerb else turned_deg,
                "speed_mps": speeds,
            }
            number += 1


def _speeds(actor: Mapping[str, Any]) -> list[float]:
    return list(actor["speed_mps"].values())


_Walk = tuple[float, float, dict[float, float]]
"""Distance from the lanes at first, direction in degrees (90: towards the lanes), speed by time."""


def _to_the_kerb(rng: np.random.Generator, passes_s: float) -> _Walk:
    stops_m, speed = float(rng.uniform(*_KERB_M)), float(rng.uniform(*_SPEED_MPS))
    there_s = max(passes_s - float(rng.uniform(*_BEFORE_S)), 0.2)
    walks_s = min(float(rng.uniform(*_APPROACH_S)), there_s - 0.1)
    aside_m = stops_m + speed * (walks_s + 0.5 * (_STARTS_S + _STOPS_S))
    return aside_m, 90.0, _from(there_s - walks_s, speed) | {there_s: speed, there_s + _STOPS_S: 0.0}


def _on_the_pavement(rng: np.random.Generator, passes_s: float) -> _Walk:
    speed = 0.0 if rng.random() < _STANDS else float(rng.uniform(*_SPEED_MPS))
    begins_s, ends_s = max(passes_s - _WALKS_S[0], 0.1), passes_s + _WALKS_S[1]
    walks = _from(begins_s, speed) | {ends_s: speed, ends_s + _STOPS_S: 0.0}
    return float(rng.uniform(*_PAVEMENT_M)), float(rng.choice((0.0, 180.0))), walks


def _from(begins_s: float, speed_mps: float) -> dict[float, float]:
    return {0.0: 0.0, begins_s - _STARTS_S: 0.0, begins_s: speed_mps}
