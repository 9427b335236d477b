"""The kinds of road in the robustness suite, and the properties of each drive, by its number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RoadKind:
    """A kind of road. Pairs are minimum and maximum of a uniform distribution."""

    name: str
    """Name, by which failures are grouped."""
    speed_kmh: tuple[float, float]
    """Speed of the traffic."""
    lanes: tuple[int, int]
    """Number of lanes in the ego vehicle's direction."""
    lane_m: tuple[float, float]
    """Width of a lane."""
    median_m: float
    """Width of the median between the directions."""
    shoulder_m: float
    """Width of the shoulder beside the outermost lanes."""
    sideways_mps2: tuple[float, float]
    """Lateral acceleration in its bends."""
    kinds: tuple[float, float, float, float, float]
    """Shares of car, van, truck, bus, motorcycle."""
    parked: bool = False
    """Whether cars are parked beside it."""
    stops: bool = False
    """Whether traffic comes to a stop."""


ROAD_KINDS = (
    RoadKind(
        "street", (30.0, 55.0), (1, 2), (2.9, 3.3), 0.0, 2.5, (0.3, 2.0), (0.72, 0.14, 0.06, 0.04, 0.04), True, True
    ),
    RoadKind("country", (60.0, 100.0), (1, 1), (3.1, 3.6), 0.0, 1.5, (0.5, 2.5), (0.7, 0.1, 0.14, 0.03, 0.03)),
    RoadKind("motorway", (80.0, 130.0), (2, 3), (3.5, 3.8), 4.0, 2.5, (0.2, 1.2), (0.62, 0.12, 0.22, 0.02, 0.02)),
)


@dataclass(frozen=True)
class DriveLayout:
    """Properties of a drive, by which its failures are grouped."""

    place: str
    """Name of the kind of road."""
    lead: bool
    """Whether there is a lead."""
    cut_in: bool
    """Whether a car cuts in."""
    crossing: bool
    """Whether another road with traffic crosses."""
    bends: bool
    """Whether the road has bends."""
    crests: bool
    """Whether the road has crests and dips."""
    roadworks: bool
    """Whether beacons stand on the road."""
    lanes_seen: bool
    """Whether lane lines are detected in the image."""
    routed: bool
    """Whether a route is known."""


def layout_of(seed: int, number: int) -> tuple[RoadKind, DriveLayout, np.random.Generator]:
    """The kind of road and the properties of the drive with this number, and the random generator to continue with."""
    rng = np.random.default_rng([seed, number])
    place = ROAD_KINDS[int(rng.choice(3, p=(0.45, 0.3, 0.25)))]
    chance = rng.random(8)
    many = place.name == "motorway"
    layout = DriveLayout(
        place.name,
        lead=bool(chance[0] < 0.6),
        cut_in=bool(chance[1] < 0.4) and many,
        crossing=bool(chance[2] < 0.7) and place.parked,
        bends=bool(chance[3] < 0.7),
        crests=bool(chance[4] < 0.4),
        roadworks=bool(chance[5] < 0.25) and not place.parked,
        lanes_seen=bool(chance[6] < (0.5 if place.parked else 0.9)),
        routed=bool(chance[7] < 0.3),
    )
    return place, layout, rng
