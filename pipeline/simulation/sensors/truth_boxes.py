"""A detector's boxes without a network: true vehicles projected into the image, with a detector's errors. The fast path
of the closed loop. The errors of a network are modelled: box edges are off by a share of the height (one part constant
per vehicle, since a network misjudges the same shape in the same way, and one part new in every frame), farther objects
are missed more often, and hidden ones are not detected. There are no false positives."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import or_

import numpy as np

from pipeline.alignment.projection import Pinhole, project_cuboids
from pipeline.common.geometry import corners_of
from pipeline.simulation.sensors.detection_model import BoxNoise
from pipeline.simulation.world.actors import SIZES_M, ActorKind
from pipeline.simulation.world.world_state import ActorState, World
from pipeline.types import Box, CameraCalibration, DistanceLaw, RawBoxes

LABELS: dict[ActorKind, str] = {
    "car": "car",
    "van": "car",
    "truck": "truck",
    "bus": "bus",
    "motorcycle": "motorcycle",
    "bicycle": "bicycle",
    "pedestrian": "person",
}
"""The COCO class of each kind of actor; COCO has no vans."""
LAW = DistanceLaw(
    coefficient=907.0 * SIZES_M["car"][2],
    exponent=-1.0,
    focal_px=907.0,
    truck_ratio=SIZES_M["truck"][2] / SIZES_M["car"][2],
    bus_ratio=SIZES_M["bus"][2] / SIZES_M["car"][2],
    motorcycle_ratio=SIZES_M["motorcycle"][2] / SIZES_M["car"][2],
)
"""The distance law of true boxes: a pinhole camera's, for vehicles of the simulator's usual height."""
_SCORE = 0.9
_SAMPLES = 24
"""Along each side of a box."""
_EDGES: list[float] = np.linspace(0.0, 1.0, _SAMPLES + 1).tolist()
_ALL = (1 << _SAMPLES) - 1


@dataclass(frozen=True)
class VisibleVehicle:
    """A vehicle in the image."""

    actor: ActorState
    """Whose box it is."""
    bbox: Box
    """In pixels, without errors."""
    shown: Box
    """The smallest box around the part that no nearer vehicle covers; ``bbox`` if all is covered."""
    visible: float
    """Share of the box not covered by nearer vehicles."""


def boxes(now: World, camera: CameraCalibration, noise: BoxNoise, seed: int, index: int) -> RawBoxes:
    """The boxes at one moment. The same seed, index and world give the same boxes, independently of earlier calls."""
    found, labels = [], []
    for seen in in_image(now, camera):
        actor = seen.actor.actor
        lasting = np.random.default_rng([seed, 3, actor.id]).standard_normal(4)
        rng = np.random.default_rng([seed, 4, index, actor.id])
        away_m = float(np.hypot(*seen.actor.cuboid.center[:2]))
        found_share = (1.0 - noise.missed) / (1.0 + np.exp((away_m - noise.reach_m) / noise.fall_off_m))
        if rng.random() > found_share or seen.visible < noise.visible_share:
            continue
        height = seen.bbox[3] - seen.bbox[1]
        edge_px = np.hypot(noise.frame_share * height, noise.edge_px)
        off = lasting * noise.lasting_share * height + rng.standard_normal(4) * edge_px
        box = np.clip(np.array(seen.bbox) + off, 0.0, np.tile([camera.width, camera.height], 2))
        if box[2] > box[0] and box[3] > box[1]:
            found.append(box)
            labels.append(LABELS[actor.kind])
    edges = np.array(found, dtype=np.float32).reshape(-1, 4)
    return RawBoxes("truth", edges, np.full(len(edges), _SCORE, np.float32), tuple(labels), LAW)


def in_image(now: World, camera: CameraCalibration) -> tuple[VisibleVehicle, ...]:
    """Every vehicle ahead whose cuboid falls into the image, nearest first."""
    alignment = Pinhole(camera.K, camera.distortion, camera.T_camera_ego)
    corners = corners_of([state.cuboid for state in reversed(now.actors)])
    if not len(corners):
        return ()
    ahead = np.flatnonzero(corners[:, :4, 0].max(axis=1) > 0.0)
    boxes = project_cuboids(alignment, corners[ahead], camera.width, camera.height)
    nearer: list[Box] = []
    seen = []
    for n, bbox in zip(ahead.tolist(), boxes, strict=True):
        state = now.actors[-1 - n]
        if bbox is not None:
            seen.append(VisibleVehicle(state, bbox, *visible_part(bbox, nearer)))
            nearer.append(bbox)
    return tuple(seen)


def visible_part(bbox: Box, nearer: Sequence[Box]) -> tuple[Box, float]:
    """The smallest box around what none of the nearer boxes covers, and its share of ``bbox``, by sampling. Where all
    is covered: ``bbox`` and 0."""
    if not nearer:
        return bbox, 1.0
    x1, y1, x2, y2 = bbox
    u_edges, v_edges = [x1 + edge * (x2 - x1) for edge in _EDGES], [y1 + edge * (y2 - y1) for edge in _EDGES]
    u, v = _middles(u_edges), _middles(v_edges)
    columns = [_ALL] * _SAMPLES  # one bit for each sample of a column that is visible
    for left, top, right, bottom in nearer:
        open_rows = _ALL ^ ((1 << bisect_left(v, bottom)) - 1 & -(1 << bisect_right(v, top)))
        for n in range(bisect_right(u, left), bisect_left(u, right)):
            columns[n] &= open_rows
    rows = reduce(or_, columns)
    if not rows:
        return bbox, 0.0
    seen = [n for n, column in enumerate(columns) if column]
    lowest, highest = (rows & -rows).bit_length() - 1, rows.bit_length()
    shown = (u_edges[seen[0]], v_edges[lowest], u_edges[seen[-1] + 1], v_edges[highest])
    return shown, sum(column.bit_count() for column in columns) / _SAMPLES**2


def _middles(edges: Sequence[float]) -> list[float]:
    return [(one + other) / 2 for one, other in pairwise(edges)]
