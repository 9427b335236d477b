"""Counts the LiDAR points in each labelled cuboid of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np

from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.base import LabeledDrive
from pipeline.labels.model import LabelSet
from pipeline.types import F32, F64, I64

_READERS = 2
"""Unpacking and counting release the GIL."""
_TOGETHER = 16
"""Frames per task: neighbours are in one chunk of a session, which is then unpacked once."""


def points_inside(labels: LabelSet, drive: LabeledDrive) -> dict[tuple[int, int], int]:
    """(track, frame) → points in the cuboid; frames without a LiDAR have none."""
    by_frame: dict[int, list[tuple[int, Cuboid]]] = {}
    for track in labels.tracks:
        for each in track.sightings:
            if each.cuboid is not None:
                by_frame.setdefault(each.frame, []).append((track.id, each.cuboid))
    frames = sorted(by_frame)

    def counted(first: int) -> dict[tuple[int, int], int]:
        found: dict[tuple[int, int], int] = {}
        for frame in frames[first : first + _TOGETHER]:
            points = drive.points(frame)
            if points is not None:
                numbers, cuboids = zip(*by_frame[frame], strict=True)
                counts = count_inside(points, cuboids).tolist()
                found |= {(number, frame): count for number, count in zip(numbers, counts, strict=True)}
        return found

    with ThreadPoolExecutor(_READERS, "cipv-count-points") as readers:
        parts = readers.map(counted, range(0, len(frames), _TOGETHER))
        return {key: count for part in parts for key, count in part.items()}


def count_inside(points: F32, cuboids: Sequence[Cuboid]) -> I64:
    """(M,) number of (N, 3 or more) ego points in each of M cuboids, including their faces."""
    numbers = np.array([(*each.center, *each.size, each.yaw_rad) for each in cuboids], dtype=np.float64)
    numbers = numbers.reshape(-1, 7)
    turns = np.column_stack([np.cos(numbers[:, 6]), np.sin(numbers[:, 6])])
    reach_m = np.hypot(numbers[:, 3:4], numbers[:, 4:5]) / 2 + 1e-3  # plus a millimetre for rounding
    reach = np.hstack([numbers[:, :2] - reach_m, numbers[:, :2] + reach_m])
    counts: I64 = _counted(points, numbers[:, :3], numbers[:, 3:6] / 2, turns, reach)
    return counts


@numba.njit(cache=True, nogil=True)
def _counted(points: F32, centers: F64, halves: F64, turns: F64, reach: F64) -> I64:  # pragma: no cover
    """turns: (M, 2) cosine and sine of yaw. reach: (M, 4) minimum x y and maximum x y of each cuboid."""
    counts = np.zeros(len(centers), dtype=np.int64)
    if len(centers) == 0:
        return counts
    least_x, least_y = reach[:, 0].min(), reach[:, 1].min()
    most_x, most_y = reach[:, 2].max(), reach[:, 3].max()
    for i in range(len(points)):
        px, py, pz = np.float64(points[i, 0]), np.float64(points[i, 1]), np.float64(points[i, 2])
        if px < least_x or px > most_x or py < least_y or py > most_y:
            continue
        for k in range(len(centers)):
            if px < reach[k, 0] or px > reach[k, 2] or py < reach[k, 1] or py > reach[k, 3]:
                continue
            x, y, z = px - centers[k, 0], py - centers[k, 1], pz - centers[k, 2]
            c, s = turns[k, 0], turns[k, 1]
            is_along = abs(x * c + y * s) <= halves[k, 0]
            if is_along and abs(y * c - x * s) <= halves[k, 1] and abs(z) <= halves[k, 2]:
                counts[k] += 1
    return counts
