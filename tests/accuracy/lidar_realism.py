"""How like a real VLP-16 the simulated one is: labelled frames of a real drive, simulated again at the real mount.

Every labelled vehicle is set up as the simulator's own vehicle of its kind and size, on the ground as the real sweep
has it, and swept from where the real sensor is. Then points and rings on each car are counted in both sweeps. What
hides a car from the real sensor without being labelled (hedges, rails) does not hide it here; paint is drawn by lot.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.simulation.sensors.lidar.model import LidarModel
from pipeline.simulation.sensors.lidar.rays import BOX_FIELDS
from pipeline.simulation.sensors.lidar.scene import actor_boxes
from pipeline.simulation.sensors.lidar.sensor import Lidar
from pipeline.simulation.world.actors import ActorKind, RoadUser
from pipeline.simulation.world.world_state import ActorState
from pipeline.sources.astyx import AstyxSource, parse_calibration
from pipeline.types import F64, Sweep
from pipeline.types.source import TruthObject

BIN_M = 10.0
_KINDS: dict[str, ActorKind] = {
    "car": "car",
    "truck": "truck",
    "trailer": "truck",
    "bus": "bus",
    "motorcycle": "motorcycle",
}
_IMAGE_SIZE = (2048, 618)
_AROUND_M, _OFF_GROUND_M = 0.2, 0.15
_FLAT_RINGS, _FIT_M, _FIT_OFF_M = 5, 16.0, (0.6, 0.25, 0.12, 0.12)


@dataclass(frozen=True)
class CarSeen:
    """One labelled car: its distance, its lateral position, and the number of points and rings on it in the real and in
    the simulated sweep."""

    distance_m: float
    left_m: float
    real_points: int
    real_rings: int
    simulated_points: int
    simulated_rings: int


@dataclass(frozen=True)
class Pair:
    """A real sweep and the simulated one of the same scene, both in the ego frame."""

    name: str
    real: Sweep
    simulated: Sweep
    truth: tuple[TruthObject, ...]


def pairs(folder: Path, seed: int = 1) -> Iterator[Pair]:
    """Each labelled frame of an Astyx recording with its simulated twin."""
    source = AstyxSource(f"astyx:{folder}", str(folder))
    calibration = sorted((folder / "calibration").glob("*.json"))[0]
    T_ego_lidar, _ = parse_calibration(calibration.read_bytes(), calibration.name, _IMAGE_SIZE)
    sensor = Lidar(LidarModel(motion=False), T_ego_lidar)
    for index in range(len(source)):
        frame, truth = source.frame(index), source.truth(index)
        if frame.sweep is None or not truth:
            continue
        rng = np.random.default_rng([seed, index])
        boxes = np.array([row for item in truth for row in _boxes(item, rng)]).reshape(-1, BOX_FIELDS)
        simulated = sensor.sweep_of(boxes, np.append(ground_plane(frame.sweep), 0.0), rng, frame.t_ns)
        yield Pair(frame.name, frame.sweep, simulated, truth)


def cars_seen(pair: Pair) -> list[CarSeen]:
    """The cars of one frame."""
    seen = []
    for item in pair.truth:
        if item.label == "car":
            real, simulated = (_on(sweep, item.cuboid) for sweep in (pair.real, pair.simulated))
            seen.append(CarSeen(float(np.hypot(*item.cuboid.center[:2])), item.cuboid.center[1], *real, *simulated))
    return seen


def ground_plane(sweep: Sweep) -> F64:
    """(3,) coefficients of z = a + b·x + c·y of the ground ahead: least squares on the lowest rings, repeated without
    points that are off the plane."""
    x, y, z = sweep.points[sweep.ring < _FLAT_RINGS, :3].astype(np.float64).T
    near = (x > 2.0) & (x < _FIT_M) & (np.abs(y) < x)
    A, z = np.column_stack([np.ones(near.sum()), x[near], y[near]]), z[near]
    plane = np.array([np.percentile(z, 10), 0.0, 0.0])
    for off_m in _FIT_OFF_M:
        flat = np.abs(A @ plane - z) < off_m
        plane = np.linalg.lstsq(A[flat], z[flat], rcond=None)[0]
    return plane


def _boxes(item: TruthObject, rng: np.random.Generator) -> list[tuple[float, ...]]:
    kind = _KINDS.get(item.label)
    if kind is None:
        return []
    grey = int(rng.integers(15, 245))
    vehicle = RoadUser(id=1, kind=kind, colour=f"#{grey:02x}{grey:02x}{grey:02x}")
    return actor_boxes(ActorState(vehicle, item.cuboid, 0.0, False, 0.0))


def _on(sweep: Sweep, cuboid: Cuboid) -> tuple[int, int]:
    """Number of points and rings on an object, without the ground below it."""
    away = sweep.points[:, :3] - np.array(cuboid.center)
    c, s = np.cos(cuboid.yaw_rad), np.sin(cuboid.yaw_rad)
    along, across = away[:, 0] * c + away[:, 1] * s, away[:, 1] * c - away[:, 0] * s
    half_l, half_w, half_h = (side / 2 for side in cuboid.size)
    inside = (np.abs(along) < half_l + _AROUND_M) & (np.abs(across) < half_w + _AROUND_M)
    inside &= (away[:, 2] > _OFF_GROUND_M - half_h) & (away[:, 2] < half_h + _AROUND_M)
    return int(inside.sum()), len(np.unique(sweep.ring[inside]))
