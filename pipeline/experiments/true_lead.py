"""The vehicle that the car will really meet first, from the simulator's ground truth: the reference for the CIPV."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.common.near_face import near_face_middle
from pipeline.evaluation.lead_verdict import LABELLED_VEHICLES
from pipeline.params import CipvParams, PathParams
from pipeline.path.corridor import nearest_on_path
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.sensors.truth_boxes import in_image
from pipeline.simulation.world import world_state
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import F64, CameraCalibration, Path, Point2

MAX_M = 60.0
OVERLAP_M = 0.9
"""A vehicle is in the path if this much of its width reaches into the corridor, or half of the width if that is
less."""
VISIBLE_SHARE = 0.35
"""A vehicle is hidden if nearer ones leave a smaller share of it visible."""
EDGE_M = 0.3
"""If the overlap differs by less than this from the limit, either answer is correct."""
_AHEAD_M, _STEP_S, _LONGEST_S, _SMALLEST_MOVE_M = 90.0, 0.25, 15.0, 0.2
_CROSSES_MPS = 2.0
_SAME_PLACE_M, _SAME_SHARE = 2.5, 0.2


@dataclass(frozen=True)
class ScriptedWay:
    """The way of the ego vehicle according to its script."""

    t_s: F64
    """(M,) seconds since the start of the scenario."""
    places: F64
    """(M, 2) world x, y."""

    @staticmethod
    def of(scene: Scenario) -> ScriptedWay:
        """The way over the whole drive and 15 s more."""
        alone = scene.without_others()
        t_s = np.arange(0.0, scene.duration_s + _LONGEST_S, _STEP_S)
        return ScriptedWay(t_s, np.array([world_state.at(alone, float(t)).pose[:2] for t in t_s]))

    def ahead(self, now: World, at_most_m: float = _AHEAD_M) -> Path | None:
        """The remaining way, at most 90 m of it, in the current ego frame; None while the car stands."""
        coming = np.vstack([now.pose[:2], self.places[self.t_s > now.t_s]])
        moved = np.hypot(*np.diff(coming, axis=0).T)
        keep = np.concatenate([[True], (moved > _SMALLEST_MOVE_M) & (np.cumsum(moved) < at_most_m)])
        if keep.sum() < 2:
            return None
        center = now.to_ego(coming[keep])
        return Path("gnss", center, center, center, PathParams().half_width_m, {}, {})


def true_lead(now: World, path: Path | None, max_m: float = MAX_M) -> tuple[ActorState | None, bool]:
    """The first vehicle on the driven path within ``max_m``, and whether that is doubtful because of one at the path's
    edge, or one that crosses and will be gone when the car arrives."""
    found: list[tuple[float, ActorState]] = []
    doubtful_m = np.inf
    for state in now.actors:
        if path is None or state.actor.kind not in LABELLED_VEHICLES or _is_beyond(state, max_m):
            continue
        if range_m(state) > max_m:
            continue
        too_little, nearest = overlap(state, path)
        if nearest <= 0.0:
            continue
        if abs(too_little) < EDGE_M or (too_little > 0.0 and _clears(state, path, now.speed_mps, nearest)):
            doubtful_m = min(doubtful_m, nearest)
        elif too_little > 0.0:
            found.append((nearest, state))
    nearest_m, lead = min(found, key=lambda pair: pair[0], default=(np.inf, None))
    return lead, bool(doubtful_m < nearest_m)


def _clears(state: ActorState, path: Path, ego_mps: float, nearest_m: float) -> bool:
    """Whether a vehicle in the path crosses it and will have left before the car is there, or just about."""
    _, along = nearest_on_path(path, np.array([state.cuboid.center[:2]]))
    reached = np.cumsum(np.hypot(*np.diff(path.center, axis=0).T))
    k = int(np.clip(np.searchsorted(reached, along[0]), 0, len(reached) - 1))
    way = path.center[k + 1] - path.center[k]
    turned = state.cuboid.yaw_rad - float(np.arctan2(way[1], way[0]))
    sideways_mps, forward_mps = abs(state.speed_mps * np.sin(turned)), state.speed_mps * np.cos(turned)
    if sideways_mps < _CROSSES_MPS or sideways_mps < abs(forward_mps):
        return False
    offsets, _ = nearest_on_path(path, state.cuboid.footprint())
    moves_left = state.speed_mps * np.sin(turned) > 0.0
    way_m = path.half_width_m - float(offsets.min()) if moves_left else path.half_width_m + float(offsets.max())
    closing_mps = ego_mps - forward_mps
    return bool(closing_mps <= 0.0 or way_m / sideways_mps < nearest_m / closing_mps)


def overlap(state: ActorState, path: Path) -> tuple[float, float]:
    """How many metres more of a vehicle's width reach into the corridor than are needed for being in the path
    (negative: fewer), and the distance along the path at which the vehicle begins."""
    offsets, along = nearest_on_path(path, state.cuboid.footprint())
    low, high, half = float(offsets.min()), float(offsets.max()), path.half_width_m
    return min(high, half) - max(low, -half) - min(OVERLAP_M, 0.5 * (high - low)), float(along.min())


@dataclass(frozen=True)
class InSight:
    """For how long each vehicle has been visible."""

    frames: Mapping[int, int] = field(default_factory=dict)
    """Number of consecutive frames by id; hidden vehicles are left out."""

    def then(self, now: World, camera: CameraCalibration) -> InSight:
        """The counts one frame later."""
        covered = _covered(now, camera)
        ids = [state.actor.id for state in now.actors if state.actor.id not in covered]
        return InSight({each: self.frames.get(each, 0) + 1 for each in ids})

    def is_hidden(self, actor: int) -> bool:
        """Whether nearer vehicles hide the vehicle from both sensors."""
        return actor not in self.frames

    def is_confirmable(self, actor: int) -> bool:
        """Whether the vehicle has been visible often enough for confirmation by a single sensor."""
        return self.frames.get(actor, 0) >= CipvParams().confirm_hits


def _covered(now: World, camera: CameraCalibration) -> frozenset[int]:
    return frozenset(seen.actor.actor.id for seen in in_image(now, camera) if seen.visible < VISIBLE_SHARE)


def near_face(state: ActorState) -> Point2:
    """Ego x, y of the middle of the face of a true vehicle that is nearest to the car."""
    a, b, c, d = ((float(x), float(y)) for x, y in state.cuboid.footprint())
    return near_face_middle((a, b, c, d))


def range_m(state: ActorState) -> float:
    """Horizontal distance from the ego origin to that point."""
    return float(np.hypot(*near_face(state)))


def _is_beyond(state: ActorState, max_m: float) -> bool:
    """Whether no part of a vehicle can be within ``max_m``; cheaper than computing its nearest face."""
    return float(np.hypot(*state.cuboid.center[:2])) - sum(state.cuboid.size[:2]) > max_m


def same_place(point: Point2, lead: ActorState) -> bool:
    """Whether a point is at a vehicle's nearest face, within a fifth of its distance."""
    x, y = near_face(lead)
    return float(np.hypot(point[0] - x, point[1] - y)) <= max(_SAME_PLACE_M, _SAME_SHARE * range_m(lead))
