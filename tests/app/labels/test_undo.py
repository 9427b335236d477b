"""Going back and forth through acts: across labels and parameters, by person, and after a restart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sqlalchemy import event

from app.labels.acts.requests import SetLead
from app.labels.errors import ActRefused
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.undo_order import Steps
from tests.app.labels.conftest import fresh, info
from tests.app.labels.doing import ACT, act, add, cuboid, label_of, relabel, shown


def test_undo_and_redo_go_through_every_act(labels: DriveLabels) -> None:
    states = [shown(labels)]
    number = add(labels)
    states.append(shown(labels))
    for label in ("truck", "bus", "car"):
        relabel(labels, number, label)
        states.append(shown(labels))
    act(labels, "Ada", SetLead(kind="set_lead", first=3, last=30, lead=number))
    states.append(shown(labels))
    for state in reversed(states[:-1]):
        labels.log.move("undo", "Ada")
        assert shown(labels) == state
    with pytest.raises(ActRefused, match="nothing to undo"):
        labels.log.move("undo", "Ada")
    for state in states[1:]:
        labels.log.move("redo", "Ada")
        assert shown(labels) == state
    with pytest.raises(ActRefused, match="nothing to redo"):
        labels.log.move("redo", "Ada")


def test_something_else_ends_what_could_be_redone(labels: DriveLabels) -> None:
    number = add(labels)
    relabel(labels, number, "bus")
    labels.log.move("undo", "Ada")
    assert labels.log.possible("Ada") == (True, True)
    relabel(labels, number, "truck")
    assert labels.log.possible("Ada") == (True, False)
    labels.log.move("undo", "Ada")
    assert label_of(labels, number) == "car"
    labels.log.move("redo", "Ada")
    assert label_of(labels, number) == "truck"


def test_whether_there_is_a_step_is_one_question_that_was_worded_before(
    labels: DriveLabels, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each slider movement sends this query, in addition to running the frame again."""
    add(labels)
    monkeypatch.setattr(Steps, "_mine", None)
    asked: list[str] = []

    def hears(connection: Any, cursor: Any, statement: str, parameters: Any, context: Any, many: bool) -> None:
        asked.extend([statement] if statement.startswith("SELECT") else [])

    event.listen(database._engine, "before_cursor_execute", hears)
    try:
        assert labels.log.possible("Ada") == (True, False)
    finally:
        event.remove(database._engine, "before_cursor_execute", hears)
    assert len(asked) == 1


def test_each_takes_back_only_their_own(labels: DriveLabels) -> None:
    ada, bob = add(labels, "Ada"), add(labels, "Bob")
    assert labels.log.move("undo", "Ada").what == f"added #{ada}, a car, in frame 11"
    assert set(labels.items("track")) == {bob}
    with pytest.raises(ActRefused, match="nothing to undo"):
        labels.log.move("undo", "Ada")


def test_what_somebody_else_changed_since_is_not_taken_back(labels: DriveLabels) -> None:
    number = add(labels, "Ada")
    relabel(labels, number, "bus", "Bob")
    with pytest.raises(ActRefused, match="Bob changed #1 since; undo would revert that too"):
        labels.log.move("undo", "Ada")
    assert label_of(labels, number) == "bus"
    labels.log.move("undo", "Bob")
    labels.log.move("undo", "Ada")
    assert not labels.items("track")


LEAD = {"kind": "set_lead", "first": 0, "last": 10, "lead": "none"}
LINE = {"kind": "set_path", "frame": 3, "left": [(0.0, 1.5), (20.0, 1.5)], "right": None}
TAG = {"kind": "tag", "first": 3, "last": 3, "tag": "night"}
EVENT = {"kind": "add_event", "frame": 10, "event": "cut_in", "tracks": [1]}
CAR = {"kind": "add_track", "label": "car", "frame": 10, "cuboid": cuboid().model_dump()}
PLACED = {"kind": "set_sighting", "track": 1, "revision": 1, "frame": 9, "cuboid": cuboid(22.0).model_dump()}
CLEARED = {"kind": "clear_lead", "first": 0, "last": 10}


@pytest.mark.parametrize(
    ("steps", "says"),
    [
        ([("Ada", LEAD), ("Ada", CLEARED), ("Bob", LEAD | {"first": 5, "last": 15}), ("Ada", "undo")],
         "frames 6–11 would have two leads: Bob made lead 2 there"),
        ([("Ada", LINE), ("Ada", "undo"), ("Bob", LINE), ("Ada", "redo")],
         "frame 4 would have two paths: Bob made path 2 there"),
        ([("Ada", TAG), ("Ada", "undo"), ("Bob", TAG), ("Ada", "redo")],
         "frame 4 would have two tags: Bob made tag 2 there"),
        ([("Ada", TAG | {"last": 9}), ("Ada", TAG | {"last": 9, "on": False}), ("Bob", TAG | {"first": 8, "last": 12}),
          ("Ada", "undo")], "frames 9–10 would have two tags: Bob made tag 2 there"),
        ([("Ada", CAR), ("Bob", LEAD | {"lead": 1}), ("Ada", "undo")], "lead 1 names #1, which would no longer exist"),
        ([("Ada", CAR), ("Bob", EVENT), ("Ada", "undo")], "event 1 names #1, which would no longer exist"),
        ([("Ada", CAR), ("Bob", LEAD | {"lead": 1}), ("Bob", "undo"), ("Ada", "undo"), ("Bob", "redo")],
         "lead 1 names #1, which would no longer exist"),
        ([("Bob", CAR), ("Ada", PLACED), ("Ada", "undo"), ("Bob", "undo"), ("Ada", "redo")],
         "Bob changed #1 since; redo would revert that too"),
    ],
)  # fmt: skip
def test_going_back_never_breaks_what_another_did_beside_it(
    sqlite_database: Database, steps: list[tuple[str, Any]], says: str
) -> None:
    labels = DriveLabels(sqlite_database, fresh(), "here")
    *first, (person, way) = steps
    for who, step in first:
        if isinstance(step, str):
            labels.log.move(step, who)  # type: ignore[arg-type]
        else:
            act(labels, who, ACT.validate_python(step))
    before = shown(labels)
    with pytest.raises(ActRefused) as refused:
        labels.log.move(way, person)
    assert str(refused.value) == says
    assert shown(labels) == before


def test_what_another_changed_and_took_back_is_in_nobodys_way(labels: DriveLabels) -> None:
    number = add(labels, "Ada")
    relabel(labels, number, "bus", "Bob")
    labels.log.move("undo", "Bob")
    labels.log.move("undo", "Ada")
    assert not labels.items("track")


def test_labels_and_parameters_are_one_stack(labels: DriveLabels) -> None:
    number = add(labels)
    labels.log.settle({"cluster.z_weight": (0.4, 0.3)})
    relabel(labels, number, "bus")
    assert labels.log.move("undo", "Ada").params == {}
    assert labels.log.move("undo", "Ada").params == {"cluster.z_weight": 0.4}
    labels.log.move("undo", "Ada")
    assert not labels.items("track")
    labels.log.move("redo", "Ada")
    assert labels.log.move("redo", "Ada").params == {"cluster.z_weight": 0.3}


def test_nudges_of_one_slider_are_one_step(labels: DriveLabels) -> None:
    labels.log.settle({"a.b": (1, 2)}, merges=True)
    labels.log.settle({"a.b": (2, 3)}, merges=True)
    labels.log.settle({"a.c": (0, 1)}, merges=True)
    assert labels.log.move("undo", "").params == {"a.c": 0}
    assert labels.log.move("undo", "").params == {"a.b": 1}
    assert labels.log.move("redo", "").params == {"a.b": 3}
    assert labels.log.possible("") == (True, True)


def test_parameters_belong_to_the_machine_they_were_changed_on(labels: DriveLabels, database: Database) -> None:
    there = DriveLabels(database, labels.info, station="there")
    labels.log.settle({"a.b": (1, 2)})
    assert (labels.log.possible("Ada"), there.log.possible("Ada")) == ((True, False), (False, False))


def test_parameters_that_cannot_be_any_more_are_not_taken_back(labels: DriveLabels) -> None:
    labels.log.settle({"gone.name": (1, 2)})

    def check(_: object) -> None:
        raise ActRefused("no parameter named 'gone.name'")

    with pytest.raises(ActRefused, match="gone"):
        labels.log.move("undo", "", check)
    assert labels.log.possible("") == (True, False)


def test_going_back_is_possible_after_a_restart(file: Path) -> None:
    first = Database.in_file(file)
    labels = DriveLabels(first, info("drive"), station="here")
    number = add(labels)
    relabel(labels, number, "bus")
    labels.log.settle({"a.b": (1, 2)})
    labels.log.move("undo", "Ada")
    first.close()
    second = Database.in_file(file)
    labels = DriveLabels(second, info("drive"), station="here")
    assert labels.log.possible("Ada") == (True, True)
    assert labels.log.move("redo", "Ada").params == {"a.b": 2}
    for _ in range(3):
        labels.log.move("undo", "Ada")
    assert shown(labels).tracks == ()
    assert [entry.undone for entry in labels.log.history("track", number)] == [False, False, True, True]
    second.close()


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    moves=st.lists(st.tuples(st.sampled_from(["Ada", "Bob"]), st.sampled_from(["act", "undo", "redo"])), max_size=15)
)
def test_a_persons_steps_are_a_list_with_a_cursor(sqlite_database: Database, moves: list[tuple[str, str]]) -> None:
    """Two people work on their own labels, in any order: neither moves the other's cursor."""
    labels = DriveLabels(sqlite_database, fresh(), "here")
    stacks: dict[str, list[int]] = {"Ada": [], "Bob": []}
    cursor = {"Ada": 0, "Bob": 0}
    for person, move in moves:
        if move == "act":
            number = add(labels, person)
            stacks[person] = [*stacks[person][: cursor[person]], number]
            cursor[person] += 1
        else:
            wanted = cursor[person] + (1 if move == "redo" else -1)
            if 0 <= wanted <= len(stacks[person]):
                labels.log.move(move, person)  # type: ignore[arg-type]
                cursor[person] = wanted
            else:
                with pytest.raises(ActRefused):
                    labels.log.move(move, person)  # type: ignore[arg-type]
        assert set(labels.items("track")) == {n for who in stacks for n in stacks[who][: cursor[who]]}
