"""Synthetic drives: the position of each vehicle in each frame, as labelled and as estimated."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

from pipeline.evaluation.lead_verdict import LeadRule, true_lead
from pipeline.evaluation.scores.truth import DriveTruth, FrameTruth, with_velocities
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import AccCommand, Cipv, EgoState, Frame, FusedObject, Result
from pipeline.types.source import TruthObject
from tests.pipeline.build import cuboid

TICK_NS = 100_000_000
_, EMPTY = step(State(), Frame(0, "000000", 0), Params())
Place = tuple[float, float]


def labelled(key: int, x: float, y: float = 0.0, label: str = "car") -> TruthObject:
    """A car with the middle of its rear face at (x, y)."""
    return TruthObject(label, cuboid(x, y), key)


def truth(*frames: Mapping[int, Place] | None, uri: str = "made:1") -> DriveTruth:
    """One frame every 0.1 s, each with the position of every vehicle by id; None: not labelled. The lead is the nearest
    vehicle in the lane."""
    made = {}
    for n, places in enumerate(frames):
        if places is not None:
            objects = tuple(labelled(key, *place) for key, place in places.items())
            made[n * TICK_NS] = FrameTruth(n * TICK_NS, objects, true_lead(objects, LeadRule()))
    return DriveTruth(uri, tuple(n * TICK_NS for n in range(len(frames))), with_velocities(made)[0])


def believed(n: int, objects: Sequence[FusedObject], lead: int | None, acc: str | None = None) -> Result:
    """The pipeline's result of frame ``n``. acc: state of the controller; None if ego speed is unknown."""
    distance = next((item.distance_m for item in objects if item.id == lead), None)
    return dataclasses.replace(
        EMPTY,
        frame=f"{n:06d}",
        t_ns=n * TICK_NS,
        objects=tuple(objects),
        cipv=Cipv(lead, distance or 0.0, None, None, "nearest in path") if lead is not None else None,
        acc=AccCommand(acc, 0.0, 0.0, 0.0, 0.0, "") if acc is not None else None,  # type: ignore[arg-type]
        ego=EgoState(n * TICK_NS, 20.0) if acc is not None else None,
    )
