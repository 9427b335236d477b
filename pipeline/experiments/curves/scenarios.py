"""The roads and the traffic of the experiment ``curves``: bends at 3 m/s² lateral, S-curves and straights, a lead in
the lane that draws away, and decoys beside it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pipeline.experiments.straight_track import car
from pipeline.simulation.scenario import Scenario

LANE, LANES, LANE_WIDTH_M = -2, 3, 3.5
_JERK_MPS3 = 0.8
_STRAIGHT_M = 150.0
_START_M = 100.0
DURATION_S = 12.0

Shape = Literal["straight", "bend", "s_curve"]


@dataclass(frozen=True)
class CurveLayout:
    """A road, and the speed on it."""

    name: str
    """Name in cases and file names."""
    title: str
    """Title in reports."""
    shape: Shape
    """Straight, bend or S-curve."""
    radius_m: float | None
    """Radius of its bends; None if straight."""
    speed_kmh: float
    """Speed of the ego vehicle."""
    reach_m: float
    """Maximum distance of a scored lead."""
    wanted: float
    """Required share of correct frames."""

    @property
    def speed_mps(self) -> float:
        return self.speed_kmh / 3.6


LAYOUTS = {
    layout.name: layout
    for layout in (
        CurveLayout("straight", "straight, 100 km/h", "straight", None, 100.0, 100.0, 0.95),
        CurveLayout("r125", "R = 125 m, 70 km/h", "bend", 125.0, 70.0, 60.0, 0.99),
        CurveLayout("r250", "R = 250 m, 99 km/h", "bend", 250.0, 99.0, 60.0, 0.99),
        CurveLayout("r500", "R = 500 m, 139 km/h", "bend", 500.0, 139.0, 100.0, 0.95),
        CurveLayout("s125", "S-curve, R = 125 m, 70 km/h", "s_curve", 125.0, 70.0, 60.0, 0.99),
        CurveLayout("s500", "S-curve, R = 500 m, 139 km/h", "s_curve", 500.0, 139.0, 100.0, 0.95),
    )
}


def scenario(layout: CurveLayout, seed: int) -> Scenario:
    """A drive behind a lead. With even seeds the road bends to the left first, with odd ones to the right. The lead
    draws away from 20 m to the scored range. In each adjacent lane, two cars drive at 20–100 m, a little faster or
    slower than the ego vehicle."""
    rng = np.random.default_rng([seed, list(LAYOUTS).index(layout.name)])
    speed = layout.speed_mps
    gain = (layout.reach_m - 22.0) / DURATION_S
    beside = [(lane, first) for lane in (LANE + 1, LANE - 1) for first in (20.0, 62.0)]
    decoys = [
        car(10 + k, lane, float(rng.uniform(ahead, ahead + 35.0)), {0.0: speed + float(rng.uniform(-1.0, 1.0))})
        for k, (lane, ahead) in enumerate(beside)
    ]
    return _scene(layout, seed, [car(1, LANE, 20.0, {0.0: speed + gain}), *decoys])


def cut_in(layout: CurveLayout, seed: int) -> tuple[Scenario, float]:
    """The same road with a lead at 60 m, before which a car cuts in from the next lane within 3 s; and the time at
    which its nearer wheel crosses the lane line."""
    side = 1 if seed % 2 else -1
    start_s, takes_s = 5.0, 3.0
    change = {"start_s": start_s, "duration_s": takes_s, "lane": LANE}
    speed = {0.0: layout.speed_mps}
    cutting_in = car(2, LANE + side, 25.0, speed) | {"lane_changes": [change]}
    scene = _scene(layout, seed, [car(1, LANE, 58.0, speed), cutting_in])
    half_car_m = scene.actors[1].size()[1] / 2
    share = np.linspace(0.0, 1.0, 1001)
    moved = LANE_WIDTH_M * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    over = share[int(np.argmax(moved >= LANE_WIDTH_M / 2 - half_car_m))]
    return scene, start_s + takes_s * float(over)


def _scene(layout: CurveLayout, seed: int, actors: list[dict[str, Any]]) -> Scenario:
    return Scenario.model_validate(
        {
            "title": layout.title,
            "seed": 1000 + seed,
            "duration_s": DURATION_S,
            "road": {
                "segments": _segments(layout, -1.0 if seed % 2 else 1.0),
                "lane_width_m": LANE_WIDTH_M,
                "lanes_forward": LANES,
                "lanes_oncoming": 0,
            },
            "ego": {"lane": LANE, "speed_mps": {0.0: layout.speed_mps}, "start_m": _START_M},
            "actors": actors,
        }
    )


def _segments(layout: CurveLayout, side: float) -> list[dict[str, float]]:
    """Segments of the road. The length of a transition curve follows from the usual lateral jerk, v³/(R·j)."""
    if layout.radius_m is None:
        return [{"length_m": 5000.0}]
    bend = side / layout.radius_m
    transition = layout.speed_mps**3 / layout.radius_m / _JERK_MPS3
    arc = 4.0 * layout.speed_mps
    into = [
        {"length_m": _STRAIGHT_M},
        {"length_m": transition, "end_curvature_per_m": bend},
        {"length_m": arc, "curvature_per_m": bend},
    ]
    if layout.shape == "bend":
        return [*into, {"length_m": transition, "curvature_per_m": bend, "end_curvature_per_m": 0.0}, {"length_m": 2e3}]
    return [
        *into,
        {"length_m": 2 * transition, "curvature_per_m": bend, "end_curvature_per_m": -bend},
        {"length_m": arc, "curvature_per_m": -bend},
        {"length_m": 2e3},
    ]
