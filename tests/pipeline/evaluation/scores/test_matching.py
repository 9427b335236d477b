"""Which object stands for which vehicle, and the errors' signs."""

from __future__ import annotations

import pytest

from pipeline.evaluation.scores.matching import Error, errors
from pipeline.types import FusedObject
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import TICK_NS, believed, truth


def found(*objects: FusedObject) -> tuple[Error, ...]:
    """Matches with a standing car 20 m ahead, closing at 10 m/s, and another car 30 m ahead in the next lane."""
    known = truth({1: (21.0, 0.0), 2: (31.0, 3.5)}, {1: (20.0, 0.0), 2: (30.0, 3.5)}, {1: (19.0, 0.0), 2: (29.0, 3.5)})
    return errors(believed(1, objects, None), known.frames[TICK_NS])


def test_errors_are_believed_minus_true() -> None:
    (error,) = found(fused(7, 20.5, -0.3, velocity=(-8.0, 0.0)))
    assert error.source == "VL"
    assert error.range_m == pytest.approx(20.0)
    assert error.distance_m == pytest.approx(0.5, abs=0.01)
    assert error.lateral_m == pytest.approx(-0.3)
    assert error.longitudinal_m == pytest.approx(0.5)
    assert error.speed_mps == pytest.approx(2.0)


def test_speed_is_unknown_where_nobody_knows_it() -> None:
    (error,) = found(fused(7, 20.5, velocity=None))
    assert error.speed_mps is None


@pytest.mark.parametrize(
    ("objects", "matched"),
    [
        pytest.param([], 0, id="nothing seen"),
        pytest.param([fused(7, 20.0), fused(8, 20.4)], 1, id="one object a vehicle"),
        pytest.param([fused(7, 20.0), fused(8, 30.0, 3.5)], 2, id="both"),
        pytest.param([fused(7, 20.0, -3.0)], 0, id="too far to the side"),
        pytest.param([fused(7, 14.0, source="V")], 1, id="a box height may be off by a third"),
        pytest.param([fused(7, 14.0, source="L")], 0, id="a LiDAR may not"),
        pytest.param([fused(7, None, source="V")], 0, id="nobody knows where it is"),
    ],
)
def test_one_to_one_within_reach(objects: list[FusedObject], matched: int) -> None:
    assert len(found(*objects)) == matched


def test_what_is_not_seen_in_this_frame_is_not_measured() -> None:
    carried = fused(7, 20.0)
    object.__setattr__(carried, "seen_by", "")
    assert found(carried) == ()


def test_the_pairs_are_nearest_together() -> None:
    """The V object at 24 m could match both cars; it is nearer to the car at 20 m, but so is the other object."""
    known = truth({1: (20.0, 0.0), 2: (30.0, 1.0)})
    seen = [fused(7, 21.0, 0.0, source="V"), fused(8, 24.0, 0.5, source="V")]
    by_range = {round(error.range_m): error.distance_m for error in errors(believed(0, seen, None), known.frames[0])}
    assert by_range == {20: pytest.approx(1.0, abs=0.02), 30: pytest.approx(-6.0, abs=0.02)}


def test_a_missed_vehicle_does_not_take_its_neighbours_object() -> None:
    """The V object at 22.3 m is the car at 22 m. The car beside it was missed, and there is a ghost 7 m behind: both
    cars could be given an object, the right one to the wrong car."""
    known = truth({1: (22.0, 0.0), 2: (20.0, 2.4)})
    seen = [fused(7, 22.3, 0.2, source="V"), fused(8, 29.0, 0.0, source="V")]
    (error,) = errors(believed(0, seen, None), known.frames[0])
    assert round(error.range_m) == 22
    assert error.distance_m == pytest.approx(0.3, abs=0.05)
