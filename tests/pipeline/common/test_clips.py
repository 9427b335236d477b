"""Where one clip of a recording ends and the next begins."""

from __future__ import annotations

import pytest

from pipeline.common.clips import begins_clip, first_frames
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import EgoState, Frame

S = 1_000_000_000


@pytest.mark.parametrize(
    ("step_ns", "begins"),
    [(S // 10, False), (1.5 * S, False), (1.5 * S + 1, True), (0, True), (-1, True), (-3441 * S, True)],
)
def test_a_clip_begins_after_a_long_gap_and_where_time_does_not_go_on(step_ns: int, begins: bool):
    assert begins_clip(7 * S, int(7 * S + step_ns), 1.5) is begins


def test_first_frames():
    assert first_frames([], 1.5) == []
    assert first_frames([0, S, 2 * S, 10 * S, 11 * S, 3 * S], 1.5) == [0, 3, 5]


def test_the_pipeline_starts_anew_where_a_clip_begins():
    """Ego motion is predicted for up to two seconds, but not into another clip that begins a second earlier."""
    ticks = [10 * S, 11 * S, 10 * S, 11 * S]
    frames = [Frame(n, str(n), t, ego=EgoState(t, 20.0) if n == 1 else None) for n, t in enumerate(ticks)]
    state, commands = State(), []
    for frame in frames:
        state, result = step(state, frame, Params())
        commands.append(result.acc)
    assert [command is not None for command in commands] == [False, True, False, False]
    assert first_frames(ticks, Params().time.reset_gap_s) == [0, 2]
