"""The desk between parameters and the log of what is open."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from app.control import Control, Wish
from app.labels.desk import LabelDesk
from app.labels.log import Log
from pipeline.params import Params


@pytest.fixture
def control() -> Control:
    return Control(Wish(Params()))


@pytest.fixture
def desk(control: Control) -> Iterator[LabelDesk]:
    """Of something without frames: parameters alone are changed."""
    desk = LabelDesk()
    desk.start(control)
    desk.open("live:a car", None)
    yield desk
    desk.stop()


def test_two_long_addresses_are_two_drives(desk: LabelDesk, control: Control) -> None:
    long = "live:" + "a" * 200
    desk.open(long + "1", None)
    control.change_params({"cipv.confirm_hits": 5})
    assert desk.state.can_undo
    desk.open(long + "2", None)
    desk.refresh()
    assert not desk.state.can_undo
    desk.open(long + "1", None)
    desk.refresh()
    assert desk.state.can_undo


def test_what_a_person_changed_is_not_offered_to_nobody(desk: LabelDesk, control: Control) -> None:
    control.change_params({"cipv.confirm_hits": 5}, person="Ada")
    assert (desk.state.can_undo, desk.possible(""), desk.possible("Ada")) == (False, (False, False), (True, False))
    assert desk.move("undo", "Ada").acted.what == "cipv.confirm_hits 3 → 5"


def test_nobody_changes_parameters_between_an_undo_and_what_it_restores(
    desk: LabelDesk, control: Control, monkeypatch: pytest.MonkeyPatch
) -> None:
    control.change_params({"cipv.confirm_hits": 5})
    move, others = Log.move, []

    def move_and_let_another_in(self: Log, *args: Any, **more: Any) -> Any:
        done = move(self, *args, **more)
        change = {"cipv.confirm_hits": 7}
        others.append(threading.Thread(target=control.change_params, args=(change,), kwargs={"person": "Bob"}))
        others[0].start()
        others[0].join(0.2)  # it would be done by then, were it not held back
        return done

    seen: list[int] = []
    restore = control.restore

    def restored(changes: Any) -> None:
        seen.append(control.peek().params.cipv.confirm_hits)
        restore(changes)

    monkeypatch.setattr(Log, "move", move_and_let_another_in)
    monkeypatch.setattr(control, "restore", restored)
    desk.move("undo", "")
    others[0].join()
    assert (seen, control.peek().params.cipv.confirm_hits) == ([5], 7)
