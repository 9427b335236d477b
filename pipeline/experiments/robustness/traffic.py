"""Random traffic for the robustness suite: a kilometre of street, country road or motorway, by its number.

Each drive has parked rows, people, crossings, bends, crests, roadworks, leads that wander and stop, cars that cut in
and out, and its own sensor faults. The ego vehicle follows a script without collisions, so the suite judges what the
pipeline would brake for, not the consequences.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.experiments.robustness.following import STEP_S, Drive, following, places_m, steady, wandering
from pipeline.experiments.robustness.people import people
from pipeline.experiments.robustness.road_kinds import DriveLayout, RoadKind, layout_of
from pipeline.simulation.scenario import Scenario

DRIVE_M = 1000.0
"""Length of each drive."""
_BEYOND_M, _START_M = 900.0, 100.0
_LONGEST_S = 160.0
_JERK_MPS3 = 0.8
_EGO, _PARKED, _ONCOMING, _BESIDE, _CROSSING = 0, 100, 1000, 2000, 3000
_KINDS = ("car", "van", "truck", "bus", "motorcycle")
_COLOURS = ("#e8e8e6", "#20252c", "#a3202a", "#2f5f8f", "#8090a0", "#5b6f86", "#101214", "#c7c9cc")


def scenario(seed: int, number: int) -> Scenario:
    """The drive with this number. The same seed and number always give the same drive."""
    place, layout, rng = layout_of(seed, number)
    usual = float(rng.uniform(*place.speed_kmh)) / 3.6
    lanes = int(rng.integers(place.lanes[0], place.lanes[1] + 1))
    lane_m = float(rng.uniform(*place.lane_m))
    own_lane = -int(rng.integers(1, lanes + 1))
    steps = int(_LONGEST_S / STEP_S)
    actors: list[dict[str, Any]] = []
    ahead: list[tuple[int, int, Drive]] = []
    lead: Drive | None = None
    if layout.lead:
        lead = wandering(rng, steps, usual * float(rng.uniform(0.6, 1.0)), float(rng.uniform(15.0, 80.0)), place.stops)
        ahead.append((0, steps, lead))
        actors.append(_vehicle(rng, 1, place, own_lane, lead))
    start = usual * float(rng.uniform(0.8, 1.0)) if lead is None else min(usual, float(lead.speeds_mps[0]) + 2.0)
    own = following(ahead, steps, usual, start, 0.0)
    if layout.cut_in and lanes > 1:
        cutting = _cut_in(rng, place, own, own_lane, lanes, lead, steps)
        if cutting is not None:
            first, drive, actor = cutting
            ahead.append((first, steps, drive))
            actors.append(actor)
            own = following(ahead, steps, usual, start, 0.0)
    way = places_m(own, 0.0)
    duration = float(np.interp(DRIVE_M, way, np.arange(steps) * STEP_S)) if way[-1] > DRIVE_M else _LONGEST_S
    road = _road(rng, place, layout, lanes, lane_m, usual)
    ego: dict[str, Any] = {"lane": own_lane, "speed_mps": Drive(own, way).script(), "start_m": _START_M}
    ego["offset_m"] = round(float(rng.normal(0.0, 0.12)), 2)
    if layout.roadworks and lanes > 1 and lead is None:
        _roadworks(rng, road, ego, own_lane, lane_m, place, way)
    if place.parked:
        actors += _parked_rows(rng, road, lanes, lane_m)
    actors += _oncoming(rng, place, road["lanes_oncoming"], usual)
    if lanes > 1:
        actors += _beside(rng, place, own_lane, lanes, usual, {each["lane"] for each in actors if each["id"] < 100})
    walkers = people(np.random.default_rng([seed, number, 1]), road, actors, way[way <= DRIVE_M], _START_M)
    return Scenario.model_validate(
        {
            "title": f"{place.name} {number}",
            "seed": (seed * 1_000_003 + number) % 2**31,
            "duration_s": round(duration, 1),
            "road": road,
            "ego": ego,
            "actors": actors,
            "crossing_actors": _crossing(rng, road, way) if layout.crossing else [],
            "free_actors": list(walkers) if place.parked else [],
            "gnss": {"sigma_m": 0.02 if layout.routed else 5.0},
            "lidar": {"dropout": round(float(rng.choice((0.01, 0.05, 0.15), p=(0.6, 0.3, 0.1))), 3)},
            "detections": {"measured": True, "lines": {"missed": 0.4} if layout.lanes_seen else None},
            "faults": _faults(rng),
        }
    )


def _faults(rng: np.random.Generator) -> dict[str, Any]:
    """Sensor faults of one drive: calibration wrong by up to half a degree, images late by up to 50 ms, and a dead ring
    in one of ten drives."""

    def angle() -> float:
        return round(float(np.clip(rng.normal(0.0, 0.2), -0.5, 0.5)), 3)

    return {
        "camera_yaw_deg": angle(),
        "camera_pitch_deg": angle(),
        "camera_roll_deg": angle(),
        "nods_deg": round(float(rng.uniform(0.05, 0.35)), 3),
        "camera_skew_ms": round(float(rng.uniform(-50.0, 50.0)), 1),
        "lost_rings": sorted(map(int, rng.choice(16, 1 + rng.integers(2), replace=False)))
        if rng.random() < 0.1
        else [],
        "spurious_clusters": round(float(rng.choice((0.0, 0.02, 0.2), p=(0.5, 0.4, 0.1))), 3),
        "sweeps_lost": round(float(rng.choice((0.0, 0.02), p=(0.8, 0.2))), 3),
        "pictures_lost": round(float(rng.choice((0.0, 0.05), p=(0.8, 0.2))), 3),
    }


def _road(
    rng: np.random.Generator, place: RoadKind, layout: DriveLayout, lanes: int, lane_m: float, usual: float
) -> dict[str, Any]:
    whole, segments = 0.0, [{"length_m": float(rng.uniform(120.0, 250.0))}]
    if layout.bends:
        while whole < DRIVE_M:
            sideways = float(rng.uniform(*place.sideways_mps2))
            radius = max(usual**2 / sideways, 60.0) * float(rng.choice((-1.0, 1.0)))
            transition = min(max(usual**3 / abs(radius) / _JERK_MPS3, 10.0), 300.0)
            arc = min(float(rng.uniform(20.0, 150.0)), 0.8 * abs(radius))
            bend = 1.0 / radius
            segments += [
                {"length_m": transition, "end_curvature_per_m": bend},
                {"length_m": arc, "curvature_per_m": bend},
                {"length_m": transition, "curvature_per_m": bend, "end_curvature_per_m": 0.0},
                {"length_m": float(rng.uniform(30.0, 250.0))},
            ]
            whole = sum(each["length_m"] for each in segments)
    segments.append({"length_m": DRIVE_M + _BEYOND_M})
    road: dict[str, Any] = {
        "segments": segments,
        "lane_width_m": round(lane_m, 2),
        "lanes_forward": lanes,
        "lanes_oncoming": lanes if place.median_m else 1,
        "median_m": place.median_m,
        "shoulder_m": place.shoulder_m,
    }
    if layout.crossing:
        road["crossings"] = [{"s_m": round(_START_M + float(rng.uniform(200.0, 800.0)), 1), "lane_width_m": 3.0}]
    if layout.crests:
        road["crest_radius_m"] = round(max(float(rng.uniform(600.0, 6000.0)), 4.0 * usual**2), 0)
        road["crests_every_m"] = round(float(rng.uniform(200.0, 800.0)), 0)
    return road


def _vehicle(rng: np.random.Generator, number: int, place: RoadKind, lane: int, drive: Drive) -> dict[str, Any]:
    made = _body(rng, number, place)
    return {**made, "lane": lane, "ahead_m": round(float(drive.rear_m[0]), 2), "speed_mps": drive.script(),
            "offset_m": round(float(rng.normal(0.0, 0.15)), 2)}  # fmt: skip


def _body(rng: np.random.Generator, number: int, place: RoadKind) -> dict[str, Any]:
    kind = str(rng.choice(_KINDS, p=place.kinds))
    return {"id": number, "kind": kind, "colour": str(rng.choice(_COLOURS))}


def _cut_in(
    rng: np.random.Generator,
    place: RoadKind,
    own: np.ndarray,
    own_lane: int,
    lanes: int,
    lead: Drive | None,
    steps: int,
) -> tuple[int, Drive, dict[str, Any]] | None:
    """A car from an adjacent lane that changes into the ego lane: the step from which it is there, its motion, and its
    script. None if the gap to the lead is too small."""
    sides = [lane for lane in (own_lane - 1, own_lane + 1) if -lanes <= lane <= -1]
    at = int(rng.integers(16, 60))
    way = places_m(own, 0.0)
    gap = float(rng.uniform(10.0, 30.0))
    if lead is not None and lead.rear_m[at] - way[at] < gap + 30.0:
        return None
    speed = max(float(own[at]) * float(rng.uniform(0.85, 1.1)), 3.0)
    rear = float(way[at]) + gap - speed * at * STEP_S
    if rear < 0.0:
        return None
    drive = steady(steps, speed, rear)
    if lead is not None and float((lead.rear_m - drive.rear_m)[at : at + 120].min()) < 12.0:
        return None
    actor = _vehicle(rng, 2, place, int(rng.choice(sides)), drive)
    takes_s = float(rng.uniform(2.5, 5.0))
    actor["lane_changes"] = [
        {"start_s": round(at * STEP_S - takes_s / 2, 2), "duration_s": round(takes_s, 2), "lane": own_lane}
    ]
    return at - 2, drive, actor


def _roadworks(
    rng: np.random.Generator,
    road: dict[str, Any],
    ego: dict[str, Any],
    own_lane: int,
    lane_m: float,
    place: RoadKind,
    way: np.ndarray,
) -> None:
    """Beacons close the outermost lane: a taper, then a row along the lane line. A car in that lane leaves it
    before."""
    begins_m = float(rng.uniform(350.0, 600.0))
    lanes = road["lanes_forward"]
    line_m = -(place.median_m / 2 + (lanes - 1) * lane_m)
    if own_lane == -lanes:
        at_s = float(np.interp(begins_m - 120.0, way, np.arange(len(way)) * STEP_S))
        ego["lane_changes"] = [{"start_s": round(at_s, 1), "duration_s": 3.0, "lane": own_lane + 1}]
    taper = [(begins_m + 8.0 * n, line_m - lane_m + 0.3 + (lane_m - 0.8) * n / 7) for n in range(8)]
    row = [(begins_m + 64.0 + 10.0 * n, line_m - 0.5) for n in range(int(rng.integers(10, 40)))]
    road["beacons"] = [{"s_m": round(_START_M + s, 1), "d_m": round(d, 2)} for s, d in (*taper, *row)]


def _parked_rows(rng: np.random.Generator, road: dict[str, Any], lanes: int, lane_m: float) -> Iterator[dict[str, Any]]:
    """Parked cars in stretches along both kerbs, never on a crossing."""
    number = _PARKED
    free = [each["s_m"] - _START_M for each in road.get("crossings", ())]
    aside = lane_m / 2 + 0.25 + 0.9
    for lane, side in ((-lanes, -1.0), (1, 1.0)):
        place_m = float(rng.uniform(0.0, 60.0))
        while place_m < DRIVE_M + 100.0:
            stretch = float(rng.uniform(40.0, 160.0))
            share = float(rng.uniform(0.4, 0.95))
            for along in np.arange(place_m, place_m + stretch, 6.2).tolist():
                if rng.random() > share or any(abs(along - each) < 15.0 for each in free):
                    continue
                offset = side * (aside + float(rng.uniform(-0.1, 0.4)))
                kind = "van" if rng.random() < 0.12 else "car"
                yield {
                    "id": number,
                    "kind": kind,
                    "colour": str(rng.choice(_COLOURS)),
                    "lane": lane,
                    "ahead_m": round(along, 1),
                    "speed_mps": {0.0: 0.0},
                    "offset_m": round(offset, 2),
                }
                number += 1
            place_m += stretch + float(rng.uniform(20.0, 250.0))


def _oncoming(rng: np.random.Generator, place: RoadKind, lanes: int, usual: float) -> Iterator[dict[str, Any]]:
    number, spacing = _ONCOMING, float(rng.uniform(60.0, 300.0))
    for lane in range(1, lanes + 1):
        speed, place_m = usual * float(rng.uniform(0.8, 1.1)), float(rng.uniform(40.0, 200.0))
        while place_m < 2.0 * DRIVE_M:
            body = _body(rng, number, place)
            yield {**body, "lane": lane, "ahead_m": round(place_m, 1), "speed_mps": {0.0: round(speed, 2)}}
            number += 1
            place_m += 12.0 + float(rng.exponential(spacing))


def _beside(
    rng: np.random.Generator, place: RoadKind, own_lane: int, lanes: int, usual: float, taken: set[int]
) -> Iterator[dict[str, Any]]:
    """Traffic in the adjacent lanes, with the same speed for all cars of a lane. Lanes from which a car cuts in stay
    empty."""
    number = _BESIDE
    for lane in range(-lanes, 0):
        if lane == own_lane or lane in taken:
            continue
        speed = usual * float(rng.uniform(0.75, 1.15))
        place_m = float(rng.uniform(-80.0, 30.0))
        while place_m < 500.0:
            body = _body(rng, number, place)
            yield {**body, "lane": lane, "ahead_m": round(place_m, 1), "speed_mps": {0.0: round(speed, 2)},
                   "offset_m": round(float(rng.normal(0.0, 0.15)), 2)}  # fmt: skip
            number += 1
            place_m += 20.0 + float(rng.exponential(60.0))


def _crossing(rng: np.random.Generator, road: dict[str, Any], way: np.ndarray) -> list[dict[str, Any]]:
    """Crossing cars that pass a few seconds before or after the ego vehicle."""
    at_m = road["crossings"][0]["s_m"] - _START_M
    there_s = float(np.interp(at_m, way, np.arange(len(way)) * STEP_S))
    made = []
    for n, approach in enumerate(("left", "right")):
        before = float(rng.uniform(3.0, 7.0)) if rng.random() < 0.5 else -float(rng.uniform(2.5, 6.0))
        if there_s - before > 0.0:
            made.append({
                "id": _CROSSING + n, "kind": "car", "approach": approach, "arrive_s": round(there_s - before, 1),
                "speed_mps": {0.0: round(float(rng.uniform(5.0, 12.0)), 1)}, "colour": str(rng.choice(_COLOURS)),
            })  # fmt: skip
    return made
