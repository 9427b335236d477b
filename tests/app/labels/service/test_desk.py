"""The desk between parameters and the log of what is open."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.core.control import Control, Wish
from app.engine.snapshot import Snapshot
from app.labels.service.desk import LabelDesk
from app.labels.store import database as databases
from app.labels.store.act_log import Log
from app.labels.store.database import Database
from pipeline.params import Params
from tests.app.web.serving import WAIT_S


@pytest.fixture
def control() -> Control:
    return Control(Wish(Params()))


@pytest.fixture
def desk(control: Control) -> Iterator[LabelDesk]:
    """A desk without frames: only parameters are changed."""
    desk = LabelDesk()
    desk.start(control)
    desk.open("live:a car", None)
    yield desk
    desk.stop()


def test_two_long_addresses_are_two_drives(desk: LabelDesk, control: Control) -> None:
    long = "live:" + "a" * 200
    desk.open(long + "1", None)
    control.change_params({"cipv.confirm_hits": 5})
    desk.refresh()
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
    assert desk.move("undo", "Ada", None).acted.what == "cipv.confirm_hits 3 → 5"


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
    desk.move("undo", "", None)
    others[0].join()
    assert (seen, control.peek().params.cipv.confirm_hits) == ([5], 7)


# ------------------------------------------------------------ a database that may wait


class Rounds(threading.Event):
    """Lets the desk's thread poll continuously, and reports when it has."""

    def __init__(self) -> None:
        super().__init__()
        self.begun = threading.Semaphore(0)

    def wait(self, timeout: float | None = None) -> bool:
        self.begun.release()
        return super().wait(0.005)

    def let_one_pass(self) -> None:
        for _ in range(2):
            assert self.begun.acquire(timeout=WAIT_S)


def test_it_is_opened_when_something_is_shown(control: Control, file: Path) -> None:
    opened = threading.Event()

    def open_it() -> Database:
        opened.set()
        return Database.in_file(file)

    desk, rounds = LabelDesk(open_later=open_it), Rounds()
    desk._wake = rounds
    desk.start(control)
    desk.open("live:a car", None)
    rounds.let_one_pass()
    assert not opened.is_set()
    desk.shown()
    assert opened.wait(WAIT_S)
    desk.stop()


def test_one_that_cannot_be_opened_is_said_and_keeps_nobody_from_driving(control: Control, file: Path) -> None:
    file.write_bytes(b"no database at all" * 100)
    desk = LabelDesk(open_later=lambda: Database.in_file(file))
    desk.start(control)
    desk.open("live:a car", None)
    desk.shown()
    until(desk, lambda: "not a database" in desk.state.trouble)
    control.change_params({"cipv.confirm_hits": 5})
    assert control.peek().params.cipv.confirm_hits == 5
    desk.stop()


# ------------------------------------------------------------ a database that somebody else holds


@pytest.fixture
def shared(control: Control, file: Path) -> Iterator[LabelDesk]:
    """A desk on a file that another process has open and writes to."""
    desk = LabelDesk(Database.in_file(file))
    desk.start(control)
    desk.open("live:a car", None)
    desk.refresh()
    yield desk
    desk.stop()


@contextmanager
def held(file: Path) -> Iterator[None]:
    """The database, locked for writing by another connection."""
    other = sqlite3.connect(file, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    yield
    other.execute("ROLLBACK")
    other.close()


def until(desk: LabelDesk, holds: Any) -> None:
    """Poll through the desk's own queue, since it notifies nobody of its state."""
    ended = threading.Event()
    for _ in range(int(WAIT_S / 0.02)):
        if holds():
            return
        ended.wait(0.02)
    raise AssertionError(desk.state)


def test_parameters_change_at_once_while_another_holds_the_database(
    shared: LabelDesk, control: Control, file: Path
) -> None:
    with held(file):
        for value in (5, 6):
            control.change_params({"cipv.confirm_hits": value}, person="Ada")
        control.change_params({"cluster.z_weight": 0.3})
        assert (control.peek().params.cipv.confirm_hits, control.peek().params.cluster.z_weight) == (6, 0.3)
        assert (shared.possible("Ada"), shared.possible("")) == ((True, False), (True, False))
        assert shared.state.can_undo
    undone = [shared.move("undo", "Ada", None).acted.what for _ in range(3)]
    assert undone == ["cluster.z_weight 0.4 → 0.3", "cipv.confirm_hits 5 → 6", "cipv.confirm_hits 3 → 5"]
    assert control.peek().params == Params()


def test_what_is_on_its_way_is_written_before_the_end(control: Control, file: Path) -> None:
    desk = LabelDesk(Database.in_file(file))
    desk.start(control)
    desk.open("live:a car", None)
    desk.refresh()
    with held(file):
        control.change_params({"cipv.confirm_hits": 5}, person="Ada")
    desk.stop()
    again = LabelDesk(Database.in_file(file))
    again.open("live:a car", None)
    assert again.possible("Ada") == (True, False)
    again.stop()


def test_what_could_not_be_written_is_said_until_it_can(
    control: Control, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(databases, "_BUSY_S", 0.3)
    desk = LabelDesk(Database.in_file(file))
    desk.start(control)
    desk.open("live:a car", None)
    desk.refresh()
    with held(file):
        control.change_params({"cipv.confirm_hits": 5})
        until(desk, lambda: desk.state.trouble)
        assert not desk.possible("")[0]
    words = f"A parameter change cannot be undone: labels, {file}: database is locked"
    assert desk.state.trouble == words
    assert Snapshot(Params(), labels=desk.state).state_json()["notices"] == [{"level": "warning", "text": words}]
    control.change_params({"cipv.confirm_hits": 6})
    until(desk, lambda: not desk.state.trouble)
    assert desk.possible("") == (True, False)
    desk.stop()


ACTS = (
    "import sys; from app.labels.service.desk import LabelDesk; desk = LabelDesk(); before = set(sys.modules);"
    "desk.open('live:a car', None); desk.refresh(); print(*sorted(set(sys.modules) - before))"
)


def test_once_labels_are_open_an_act_loads_no_module() -> None:
    """It must not fail because the process has no file descriptor left at that moment."""
    loaded = subprocess.run([sys.executable, "-c", ACTS], capture_output=True, text=True, check=True).stdout.split()
    assert {"app.labels.acts.registry", "app.labels.acts.scope", "app.labels.acts.measured"} <= set(loaded)
