"""Synthetic drives for scores without labels."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.common.geometry import Cuboid
from pipeline.evaluation.label_free.history import History
from pipeline.evaluation.scores.results_file import EMPTY, NO_HEALTH, NO_PATH
from pipeline.types import Cipv, FusedObject, ObjectSource, Result

STEP_NS = 100_000_000


def thing(
    number: int,
    distance_m: float,
    source: ObjectSource = "VL",
    *,
    in_path: bool = True,
    closing_mps: float = 0.0,
    carried: bool = False,
) -> FusedObject:
    """An object straight ahead."""
    return FusedObject(
        id=number,
        source=source,
        label="car",
        score=0.9,
        bbox=None,
        bev=None,
        cuboid=Cuboid((distance_m + 2.0, 0.0, 0.5), (4.0, 1.8, 1.5), 0.0) if source != "V" else None,
        closest_point=(distance_m, 0.0, 0.0),
        distance_m=distance_m,
        distance_sigma_m=1.0,
        velocity_mps=(-closing_mps, 0.0),
        seen_by="" if carried else source,
        hits=9,
        lidar_points=9,
        lidar_track=None,
        vision_track=None,
        in_path=in_path,
        path_offset_m=0.0 if in_path else 3.0,
    )


def history(frames: Sequence[tuple[int | None, Sequence[FusedObject]]]) -> History:
    """A drive at 10 Hz: each frame's lead and objects."""
    drive = History()
    for n, (lead, objects) in enumerate(frames):
        cipv = Cipv(lead, 0.0, None, None, "") if lead is not None else None
        ordered = tuple(sorted(objects, key=lambda item: item.distance_m or 0.0))
        result = Result(f"{n}", (n + 1) * STEP_NS, NO_HEALTH, None, ordered, NO_PATH, cipv, (), None, (), {}, EMPTY)
        drive.add(result)
    return drive
