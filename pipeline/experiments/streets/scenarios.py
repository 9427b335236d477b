"""The streets of the experiment ``streets``: no paint, no route, bends of 30–150 m radius between parked rows, hedges
and kerbs; with a lead that draws away or slows down, or with nothing ahead at all. And street corners, with nothing
ahead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pipeline.experiments.straight_track import car
from pipeline.simulation.scenario import Scenario

LANE_WIDTH_M, PARKING_M, PAVEMENT_M, KERB_HIGH_M = 3.0, 2.3, 2.0, 0.12
REACH_M = 40.0
"""Leads beyond this do not count."""
DURATION_S = 14.0
_START_M, _STRAIGHT_M, _ROAD_M = 100.0, 115.0, 700.0
_JERK_MPS3 = 0.8
_SPACING_M = 6.2
_PARKED = 100
_COLOURS = ("#e8e8e6", "#20252c", "#a3202a", "#2f5f8f", "#8090a0", "#5b6f86", "#101214", "#c7c9cc")

StreetBorder = Literal["parked", "hedges", "kerbs", "mixed"]
Ahead = Literal["lead", "nothing"]
CORNER_M = 12.0
"""Radius of the way around a street corner."""
SPEEDS_KMH = {CORNER_M: 15.0, 30.0: 24.0, 50.0: 31.0, 80.0: 39.0, 150.0: 48.0}
"""Speed by radius: a lateral acceleration of 1.5 m/s², as usual in streets, and at most 50 km/h."""
BESIDE: tuple[StreetBorder, ...] = ("parked", "hedges", "kerbs", "mixed")


@dataclass(frozen=True)
class Street:
    """A street without lane markings."""

    radius_m: float
    """Radius of its bends."""
    beside: StreetBorder
    """Kind of border, which shows the course of the road."""
    ahead: Ahead
    """Whether a car drives ahead."""

    @property
    def title(self) -> str:
        return f"R = {self.radius_m:.0f} m, {self.beside}, {self.ahead} ahead"

    @property
    def speed_mps(self) -> float:
        return SPEEDS_KMH[self.radius_m] / 3.6


def scenario(street: Street, seed: int) -> Scenario:
    """With even seeds, the street bends to the left first, with odd ones to the right; then the other way. The same
    seed gives the same street."""
    rng = np.random.default_rng([seed, int(street.radius_m), BESIDE.index(street.beside), street.ahead == "lead"])
    actors: list[dict[str, Any]] = []
    if street.ahead == "lead":
        actors.append(car(1, -1, float(rng.uniform(12.0, 22.0)), _of_the_lead(street, rng)))
    road = {
        "segments": _segments(street, -1.0 if seed % 2 else 1.0),
        "lane_width_m": LANE_WIDTH_M,
        "lanes_forward": 1,
        "lanes_oncoming": 1,
        "median_m": 0.0,
        "shoulder_m": PARKING_M,
        "strips": _strips(street, rng),
    }
    actors += _parked(street, rng)
    if rng.random() < 0.5:
        actors.append(car(2, 1, float(rng.uniform(60.0, 110.0)), {0.0: street.speed_mps}))
    return Scenario.model_validate(
        {
            "title": street.title,
            "seed": 2000 + seed,
            "duration_s": DURATION_S,
            "road": road,
            "ego": {"lane": -1, "speed_mps": {0.0: street.speed_mps}, "start_m": _START_M},
            "actors": actors,
            "gnss": {"sigma_m": 5.0},
        }
    )


def _of_the_lead(street: Street, rng: np.random.Generator) -> dict[float, float]:
    """Speed of the lead: first a little faster than the ego vehicle, then slower for a while, so that it draws away to
    about 40 m and comes back."""
    speed = street.speed_mps
    return {0.0: speed, 2.0: speed * float(rng.uniform(1.2, 1.5)), 7.0: speed * 1.2, 9.0: speed * 0.7}


def _segments(street: Street, side: float) -> list[dict[str, float]]:
    """Segments of the road: a bend and then one the other way, each through at most a right angle. The length of a
    transition curve follows from the lateral jerk."""
    bend = side / street.radius_m
    transition = max(street.speed_mps**3 / street.radius_m / _JERK_MPS3, 5.0)
    arc = min(3.0 * street.speed_mps, 1.2 * street.radius_m)
    return [
        {"length_m": _STRAIGHT_M},
        {"length_m": transition, "end_curvature_per_m": bend},
        {"length_m": arc, "curvature_per_m": bend},
        {"length_m": transition, "curvature_per_m": bend, "end_curvature_per_m": 0.0},
        {"length_m": 12.0},
        {"length_m": transition, "end_curvature_per_m": -bend},
        {"length_m": arc, "curvature_per_m": -bend},
        {"length_m": transition, "curvature_per_m": -bend, "end_curvature_per_m": 0.0},
        {"length_m": _ROAD_M},
    ]


def _strips(street: Street, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Borders: kerbs everywhere, behind the parking strip or, without parked cars, at the lane; hedges and walls behind
    the pavement in stretches, with gaps like those for driveways and gardens."""
    strips: list[dict[str, Any]] = []
    for side in (-1.0, 1.0):
        kerb_m = LANE_WIDTH_M + (PARKING_M if _parks(street) else 0.3)
        strips.append({"kind": "kerb", "d_m": side * (kerb_m + PAVEMENT_M / 2), "width_m": PAVEMENT_M,
                       "high_m": KERB_HIGH_M})  # fmt: skip
        if street.beside in ("hedges", "mixed"):
            place = float(rng.uniform(0.0, 20.0))
            while place < _ROAD_M:
                stretch = float(rng.uniform(15.0, 60.0))
                kind = "hedge" if rng.random() < 0.6 else "wall"
                away = kerb_m + PAVEMENT_M + float(rng.uniform(0.0, 0.6))
                high = float(rng.uniform(0.9, 1.9))
                strips.append({"kind": kind, "d_m": side * (away + 0.3), "width_m": 0.6, "from_m": place,
                               "to_m": place + stretch, "high_m": high})  # fmt: skip
                place += stretch + float(rng.uniform(3.0, 20.0))
    return strips


def _parks(street: Street) -> bool:
    return street.beside in ("parked", "mixed")


def _parked(street: Street, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Rows of parked cars along both kerbs, with gaps."""
    actors: list[dict[str, Any]] = []
    if not _parks(street):
        return actors
    for lane, side in ((-1, -1.0), (1, 1.0)):
        share = float(rng.uniform(0.5, 0.95))
        for along in np.arange(-60.0, _ROAD_M - _START_M, _SPACING_M).tolist():
            if rng.random() > share:
                continue
            made = car(_PARKED + len(actors), lane, round(along, 1), {0.0: 0.0})
            made["kind"] = "van" if rng.random() < 0.12 else "car"
            made["colour"] = str(rng.choice(_COLOURS))
            made["offset_m"] = round(side * (LANE_WIDTH_M / 2 + PARKING_M / 2 + float(rng.uniform(-0.1, 0.2))), 2)
            actors.append(made)
    return actors
