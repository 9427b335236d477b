"""A frozen version that was changed behind the program's back is refused."""

from __future__ import annotations

import pytest
from sqlalchemy import delete, update

from app.labels.errors import ActRefused
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.tables import VersionRow
from tests.app.labels.doing import add


@pytest.fixture
def frozen(labels: DriveLabels) -> DriveLabels:
    for name in ("first", "second", "third"):
        add(labels)
        labels.freeze(name, "Ada")
    return labels


def test_versions_as_they_were_frozen_are_read(frozen: DriveLabels) -> None:
    assert [len(frozen.label_set(name).tracks) for name in ("first", "second", "third")] == [1, 2, 3]


@pytest.mark.parametrize("changed", [{"labels": b"x"}, {"person": "Bob"}, {"t_unix_ms": 5}, {"name": "2nd"}])
def test_one_that_was_changed_is_refused_and_others_are_not(frozen: DriveLabels, changed: dict[str, object]) -> None:
    mine = VersionRow.drive_id == frozen._id
    with frozen._database.writing() as connection:
        connection.execute(update(VersionRow).where(mine, VersionRow.name == "second").values(changed))
    with pytest.raises(ActRefused, match="was changed in the database"):
        frozen.label_set(str(changed.get("name", "second")))
    assert len(frozen.label_set("third").tracks) == 3


def test_one_whose_predecessor_was_taken_out_is_refused(frozen: DriveLabels) -> None:
    mine = VersionRow.drive_id == frozen._id
    with frozen._database.writing() as connection:
        connection.execute(delete(VersionRow).where(mine, VersionRow.name == "second"))
    with pytest.raises(ActRefused, match="before 'third' was changed or removed"):
        frozen.label_set("third")
    assert len(frozen.label_set("first").tracks) == 1


def test_those_from_before_there_was_a_chain_are_taken_as_they_are(frozen: DriveLabels) -> None:
    mine = VersionRow.drive_id == frozen._id
    with frozen._database.writing() as connection:
        connection.execute(update(VersionRow).where(mine).values(previous="", sha256=""))
    assert len(frozen.label_set("second").tracks) == 2
