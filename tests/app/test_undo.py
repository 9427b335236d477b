"""Going back and forth through parameters."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.control import Control, Wish
from app.undo import History, Setting
from pipeline.params import Params, with_changes


def setting(hits: int) -> Setting:
    return Setting(with_changes(Params(), {"cipv.confirm_hits": hits}), "default")


def hits(of: Setting | Wish) -> int:
    return of.params.cipv.confirm_hits


@given(st.lists(st.sampled_from(["undo", "redo", 1, 2, 3, 4]), max_size=40))
def test_a_history_behaves_as_a_list_with_a_cursor(moves: list[str | int]):
    history, settings, cursor = History(setting(1)), [1], 0
    for move in moves:
        if isinstance(move, int):
            history = history.settle(setting(move))
            if move != settings[cursor]:
                settings = [*settings[: cursor + 1], move]
                cursor += 1
        else:
            wanted = cursor + (1 if move == "redo" else -1)
            moved = history.forth() if move == "redo" else history.back()
            assert (moved is not None) == (0 <= wanted < len(settings))
            if moved is not None:
                history, cursor = moved, wanted
        assert hits(history.now) == settings[cursor]
        assert bool(history.past) == (cursor > 0)


def test_changes_of_one_slider_that_is_merged_are_one_step():
    name = frozenset({"cipv.confirm_hits"})
    history = History(setting(1))
    for value in (2, 3, 4):
        history = history.settle(setting(value), name)
    history = history.settle(setting(5), frozenset({"other"}))
    back = history.back()
    assert back is not None
    assert hits(back.now) == 4
    back = back.back()
    assert back is not None
    assert hits(back.now) == 1
    assert back.back() is None


def test_the_oldest_steps_are_forgotten():
    history = History(setting(1))
    for step in range(300):
        history = history.settle(setting(1 + step % 2 + 2 * (step % 3)))
    assert len(history.past) == 100


@pytest.fixture
def control() -> Control:
    return Control(Wish(Params()))


def test_what_is_only_tried_is_no_step(control: Control):
    control.change_params({"cipv.confirm_hits": 7}, final=False)
    assert not control.peek().settled
    assert not control.can_undo
    control.change_params({"cipv.confirm_hits": 8})
    assert control.peek().settled
    assert control.undo()
    assert hits(control.peek()) == 3
    assert control.redo()
    assert hits(control.peek()) == 8


def test_undo_takes_back_what_is_being_tried_first(control: Control):
    control.change_params({"cipv.confirm_hits": 5})
    control.change_params({"cipv.confirm_hits": 9}, final=False)
    assert control.undo()
    assert (hits(control.peek()), control.peek().settled) == (5, True)
    assert control.undo()
    assert hits(control.peek()) == 3
    assert not control.undo()


def test_undo_and_redo_are_changes_with_a_revision_of_their_own(control: Control):
    first = control.change_params({"cipv.confirm_hits": 5})
    control.undo()
    control.redo()
    assert control.peek().params_revision == first + 2
    assert not control.redo()


def test_a_preset_comes_back_with_its_name(control: Control):
    control.set_params(Params(), "paper")
    control.change_params({"cipv.confirm_hits": 5})
    control.undo()
    assert control.peek().preset == "paper"
    control.undo()
    assert control.peek().preset == "default"
