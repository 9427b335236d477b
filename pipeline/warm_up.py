"""Compiles every kernel of the pipeline before the first frame."""

from __future__ import annotations

import threading
from functools import cache

import numpy as np

from pipeline import lidar
from pipeline.alignment import lens
from pipeline.common import kalman
from pipeline.common.garbage_collection import collect_rarely
from pipeline.common.geometry import iou_matrix
from pipeline.decision import path_position
from pipeline.ego_motion import registration, structure
from pipeline.fusion import free_road, returns
from pipeline.lanes import road_lines
from pipeline.path import corridor, road_edges, traffic
from pipeline.types import ground_planes, lane
from pipeline.vision import place_filter, vehicle_height

_LOCK = threading.Lock()


def warm_up() -> None:
    """Make the first frame as fast as the others: compile every kernel, or load it from numba's cache, and keep the
    garbage collector from running during frames. Only the first call does this; calls from other threads wait until it
    is done."""
    with _LOCK:
        _warm_up()


def is_warm() -> bool:
    """Whether ``warm_up`` has completed."""
    return _warm_up.cache_info().currsize > 0


@cache
def _warm_up() -> None:
    ground_planes.warm_up()
    lane.warm_up()
    lens.warm_up()
    lidar.warm_up()
    one = np.eye(2)
    kalman.update(kalman.predict(kalman.start((0.0, 0.0), one, 1.0), 0.1, 1.0), (0.0, 0.0), one)
    iou_matrix(np.zeros((1, 4)), np.zeros((1, 4)))
    structure.warm_up()
    registration.warm_up()
    free_road.warm_up()
    returns.warm_up()
    place_filter.warm_up()
    vehicle_height.warm_up()
    road_lines.warm_up()
    corridor.warm_up()
    road_edges.warm_up()
    traffic.warm_up()
    path_position.warm_up()
    collect_rarely()
