"""What deserves a reaction, and what must not cause one."""

from __future__ import annotations

import dataclasses

import pytest

from pipeline.decision.cipv import CipvState, choose
from pipeline.decision.object_motion import describe
from pipeline.decision.reaction_candidates import enters_corridor, is_dependable
from pipeline.params import CipvParams, MotionParams, PathParams
from pipeline.path.corridor import corridor
from pipeline.types import EgoState, FusedObject
from tests.pipeline.build import fused, moment

PATH = corridor(None, PathParams(half_width_m=1.5))


def judged(item: FusedObject, ego_mps: float | None = 20.0) -> FusedObject:
    """The object as the pipeline describes it before any reaction."""
    ego = EgoState(0, ego_mps) if ego_mps is not None else None
    (item,) = choose(CipvState(), describe([item], ego, MotionParams()), PATH, moment(ego), CipvParams())[1].objects
    return item


@pytest.mark.parametrize(
    ("item", "dependable"),
    [
        pytest.param(fused(1, 15.0, 3.0), True, id="both sensors"),
        pytest.param(fused(1, 15.0, 3.0, source="L"), True, id="LiDAR, confirmed, as large as a car"),
        pytest.param(fused(1, 15.0, 3.0, label="person"), True, id="a person is hit no less"),
        pytest.param(fused(1, 15.0, 3.0, source="V"), False, id="camera alone: its speed comes from a box height"),
        pytest.param(fused(1, 15.0, 3.0, source="L", hits=2), False, id="a blob seen twice"),
        pytest.param(
            dataclasses.replace(fused(1, 15.0, 3.0, hits=40), lidar_hits=2),
            False,
            id="followed by the camera for long, by the LiDAR only since the sweep before",
        ),
        pytest.param(fused(1, 15.0, 3.0, source="L", height=0.1), False, id="a kerb"),
        pytest.param(dataclasses.replace(fused(1, 15.0, 3.0), seen_by=""), False, id="not seen now"),
    ],
)
def test_dependable(item: FusedObject, dependable: bool) -> None:
    assert is_dependable(judged(item)) is dependable


def test_nothing_is_dependable_before_it_was_judged() -> None:
    assert not is_dependable(fused(1, 15.0))


@pytest.mark.parametrize(
    ("item", "ego_mps", "enters"),
    [
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, -2.0)), 20.0, True, id="a slower car swerves in"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, 0.0)), 20.0, False, id="a slower car keeps its lane"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, 2.0)), 20.0, False, id="a slower car moves away"),
        pytest.param(
            fused(1, 30.0, 3.5, velocity=(-20.0, -1.4)), 20.0, False, id="a post beside the road does not swerve"
        ),
        pytest.param(fused(1, 30.0, 2.0, velocity=(-10.0, -0.4)), 20.0, False, id="sideways noise is not believed"),
        pytest.param(fused(1, 30.0, 0.5, velocity=(-20.0, 0.0)), 20.0, True, id="a standing obstacle in the corridor"),
        pytest.param(fused(1, 30.0, -8.0, velocity=(-20.0, 6.0)), 20.0, True, id="a crossing car will be there"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(5.0, -2.0)), 20.0, False, id="it pulls away: never reached"),
        pytest.param(fused(1, 0.1, 2.7, velocity=(-2.0, -1.5)), 20.0, False, id="abreast of us"),
        pytest.param(fused(1, 30.0, 3.5, velocity=(-10.0, -2.0)), None, True, id="ego speed not known"),
    ],
)
def test_enters_corridor(item: FusedObject, ego_mps: float | None, enters: bool) -> None:
    assert enters_corridor(judged(item, ego_mps), PATH) is enters
