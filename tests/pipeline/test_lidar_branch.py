"""What needs no network is computed once: running a frame again with other parameters gives what a fresh run gives."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from pipeline import lidar_branch
from pipeline.params import Params, Section, with_changes
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import Frame
from tests.pipeline.test_step import as_bytes


@pytest.fixture(scope="module")
def last() -> tuple[State, Frame]:
    """The state before a simulated frame, and the frame."""
    source = open_source("sim:straight")
    state = State()
    for index in range(4):
        state, _ = step(state, source.frame(index), Params())
    return state, source.frame(4)


def _changes() -> list[tuple[str, Any]]:
    """For every parameter, by its dotted name, its bounds or other values than the default."""
    found: list[tuple[str, Any]] = []
    for section, held in Params():
        assert isinstance(held, Section)
        for name, field in type(held).model_fields.items():
            value = getattr(held, name)
            bounds = [m for each in field.metadata for m in (getattr(each, "ge", None), getattr(each, "le", None))]
            others: list[Any] = [bound for bound in bounds if bound is not None and bound != value]
            choices = getattr(field.annotation, "__args__", ())  # of a Literal; of a union these are types
            others += [not value] if isinstance(value, bool) else [each for each in choices if isinstance(each, str)]
            found += [(f"{section}.{name}", other) for other in others if other != value]
    return found


@pytest.mark.parametrize("change", _changes(), ids=lambda change: f"{change[0]}={change[1]}")
def test_another_parameter_gives_what_a_fresh_run_gives(change: tuple[str, Any], last: tuple[State, Frame]) -> None:
    state, frame = last
    earlier = lidar_branch.follow(state, frame, Params())
    changed = with_changes(Params(), dict([change]))
    _, fresh = step(state, frame, changed)
    _, again = step(state, frame, changed, lidar_branch.follow(state, frame, changed, earlier))
    assert as_bytes([again]) == as_bytes([fresh])


@pytest.mark.parametrize(
    ("changed", "motion", "sweep"),
    [("cipv.decide_s", True, True), ("cluster.tolerance_m", True, False), ("motion.coast_s", False, False)],
)
def test_only_what_a_parameter_affects_is_computed_again(
    changed: str, motion: bool, sweep: bool, last: tuple[State, Frame]
) -> None:
    state, frame = last
    earlier = lidar_branch.follow(state, frame, Params())
    again = lidar_branch.follow(state, frame, with_changes(Params(), {changed: 0.8}), earlier)
    assert (again.motion is earlier.motion, again.sweep is earlier.sweep) == (motion, sweep)
    assert set(again.timing_ms) == set(earlier.timing_ms)
    assert any(again.timing_ms.values()) == (not sweep), "what was not computed took no time"


def test_after_a_gap_nothing_is_carried_over(last: tuple[State, Frame]) -> None:
    state, frame = last
    assert any(track.hits > 1 for track in lidar_branch.follow(state, frame, Params()).tracks)
    branch = lidar_branch.follow(state, replace(frame, t_ns=frame.t_ns + 10_000_000_000), Params())
    assert branch.now.dt_s is None
    assert all(track.hits == 1 for track in branch.tracks)
