"""Acts and time of each person."""

from __future__ import annotations

import pytest

from app.labels.store import act_log
from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.effort import efforts
from tests.app.labels.acts.doing import BOX, act
from tests.app.labels.conftest import info


def test_acts_and_time_without_pauses_are_counted_by_person(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    labels = DriveLabels(database, info(f"effort {database.is_sqlite}"), station="here")
    now_s = [1_000_000.0]
    monkeypatch.setattr(act_log.time, "time", lambda: now_s[0])
    for wait_s, person in ((0, "Ada"), (10, "Ada"), (20, "Bob"), (600, "Ada"), (5, "Ada")):
        now_s[0] += wait_s
        act(labels, person, kind="add_track", label="car", frame=3, cuboid=BOX)
    labels.log.settle({"cipv.confirm_hits": (3, 4)}, "Ada")
    labels.log.move("undo", "Bob")
    found = {each.person: each for each in efforts(database) if each.title == "a drive" and each.acts in (2, 4)}
    ada, bob = found["Ada"], found["Bob"]
    assert (ada.acts, ada.active_s, ada.acts_per_frame) == (4, 15.0, 0.04), "parameters are no labels"
    assert (bob.acts, bob.active_s) == (2, 0.0), "ten minutes are a pause"
