"""The choice of the CIPV among given objects on a straight path, for tests."""

from __future__ import annotations

from pipeline.decision.cipv import Choice, CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.params import CipvParams, MotionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import Cipv, EgoState, FusedObject, Path
from tests.pipeline.build import moment

PARAMS = CipvParams(confirm_hits=3, hysteresis_m=0.3)
PATH = corridor(None, PathParams(half_width_m=1.5))


def decide(*objects: FusedObject, last: int | None = None) -> tuple[Cipv | None, dict[int, str]]:
    return chosen(CipvState(last), *objects)


def chosen(before: CipvState, *objects: FusedObject) -> tuple[Cipv | None, dict[int, str]]:
    _, lead, _, rejected = choose(before, objects, PATH, moment(), PARAMS)[1]
    return lead, {row.id: row.reason for row in rejected}


def over_time(frames: list[tuple[FusedObject, ...]], path: Path = PATH, ego: EgoState | None = None) -> list[Choice]:
    """Each frame's choice, ten a second."""
    state, choices = CipvState(), []
    for k, objects in enumerate(frames):
        objects = describe(objects, ego, MotionParams())
        state, choice = choose(state, objects, path, moment(ego, 0.1 if k else None), PARAMS)
        choices.append(choice)
    return choices
