"""A frozen version that was changed behind the program's back is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from sqlalchemy import delete, select, update

from app.labels.errors import ActRefused, NoSuchLabel
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.tables import NewestVersionRow, VersionRow
from app.labels.store.version_chain import _sha256
from pipeline.common.files.signing import PUBLIC_VARIABLE, SIGNING_VARIABLE, new_keys
from tests.app.labels.conftest import fresh
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


def test_the_newest_cannot_be_taken_out_unnoticed(frozen: DriveLabels) -> None:
    mine = VersionRow.drive_id == frozen._id
    with frozen._database.writing() as connection:
        connection.execute(delete(VersionRow).where(mine, VersionRow.name == "third"))
    with pytest.raises(ActRefused, match="a version after 'second' was changed or removed"):
        frozen.label_set("second")
    with pytest.raises(NoSuchLabel, match="the newest version was removed"):
        frozen.label_set("third")
    assert len(frozen.label_set("first").tracks) == 1
    frozen.freeze("fourth", "Ada")
    with pytest.raises(ActRefused, match="before 'fourth' was changed or removed"):
        frozen.label_set("fourth")


def test_all_that_there_were_cannot_be_taken_out_unnoticed(frozen: DriveLabels) -> None:
    with frozen._database.writing() as connection:
        connection.execute(delete(VersionRow).where(VersionRow.drive_id == frozen._id))
    with pytest.raises(NoSuchLabel, match="no version 'first' of these labels; the newest version was removed"):
        frozen.label_set("first")
    with pytest.raises(NoSuchLabel, match=r"labels$"):
        DriveLabels(frozen._database, fresh(), station="here").label_set("first")


def test_which_is_the_newest_is_signed(labels: DriveLabels, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    public, _ = new_keys(tmp_path / "key")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "key"))
    digests, mine = [], NewestVersionRow.drive_id == labels._id
    for name in ("first", "second"):
        add(labels)
        labels.freeze(name, "Ada")
        with labels._database.reading() as connection:
            digests.append(connection.scalars(select(NewestVersionRow.sha256).where(mine)).one())
    monkeypatch.setenv(PUBLIC_VARIABLE, str(public))
    assert len(labels.label_set("second").tracks) == 2
    with labels._database.writing() as connection:
        connection.execute(delete(VersionRow).where(VersionRow.drive_id == labels._id, VersionRow.name == "second"))
        connection.execute(update(NewestVersionRow).where(mine).values(sha256=digests[0]))
    with pytest.raises(ActRefused, match="as the newest: the signature does not match"):
        labels.label_set("first")
    with labels._database.writing() as connection:
        connection.execute(update(NewestVersionRow).where(mine).values(signature="", signed_by=""))
    with pytest.raises(ActRefused, match="as the newest: not signed"):
        labels.label_set("first")


def test_one_of_another_recording_is_refused_and_one_chained_without_its_recording_is_not(
    frozen: DriveLabels, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first version of each has none before it that would show it."""
    new_keys(tmp_path / "key")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "key"))
    other = DriveLabels(frozen._database, fresh(), station="here")
    add(other)
    other.freeze("theirs", "Ada")
    theirs = VersionRow.drive_id == other._id
    with frozen._database.writing() as connection:
        row = connection.execute(select(VersionRow.__table__).where(theirs)).mappings().one()
        connection.execute(update(VersionRow).where(theirs).values(drive_id=frozen._id))
    with pytest.raises(ActRefused, match="or is of another recording"):
        frozen.label_set("theirs")
    with frozen._database.writing() as connection:
        mine = VersionRow.drive_id == frozen._id, VersionRow.name == "theirs"
        older = {"sha256": _sha256(row, "", None), "signature": "", "signed_by": ""}
        connection.execute(update(VersionRow).where(*mine).values(older))
    assert len(frozen.label_set("theirs").tracks) == 1


def test_those_from_before_there_was_a_chain_are_taken_as_they_are(frozen: DriveLabels) -> None:
    mine = VersionRow.drive_id == frozen._id
    with frozen._database.writing() as connection:
        connection.execute(update(VersionRow).where(mine).values(previous="", sha256=""))
    assert len(frozen.label_set("second").tracks) == 2


def test_a_signed_version_is_refused_once_it_was_changed_and_its_chain_built_again(
    labels: DriveLabels, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    public, key = new_keys(tmp_path / "key")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "key"))
    add(labels)
    assert labels.freeze("first", "Ada").signed_by == key
    assert [version.signed_by for version in labels.versions()] == [key]
    monkeypatch.delenv(SIGNING_VARIABLE)
    monkeypatch.setenv(PUBLIC_VARIABLE, str(public))
    assert len(labels.label_set("first").tracks) == 1
    mine = VersionRow.drive_id == labels._id
    with labels._database.writing() as connection:
        row = connection.execute(select(VersionRow.__table__).where(mine)).mappings().one()
        forged = {**row, "person": "Bob"}
        again = {"person": "Bob", "sha256": _sha256(forged, row["previous"], labels.info.key)}
        connection.execute(update(VersionRow).where(mine).values(again))
        newest = {"sha256": again["sha256"], "signature": "", "signed_by": ""}
        connection.execute(update(NewestVersionRow).where(NewestVersionRow.drive_id == labels._id).values(newest))
    with pytest.raises(ActRefused, match="the signature does not match"):
        labels.label_set("first")
    with labels._database.writing() as connection:
        connection.execute(update(VersionRow).where(mine).values(signature="", signed_by=""))
    with pytest.raises(ActRefused, match="not signed"):
        labels.label_set("first")
    monkeypatch.delenv(PUBLIC_VARIABLE)
    assert len(labels.label_set("first").tracks) == 1, "without a key to expect, one that is not signed is read"


def test_one_that_another_key_signed_is_refused(
    labels: DriveLabels, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    new_keys(tmp_path / "theirs")
    ours, _ = new_keys(tmp_path / "ours")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "theirs"))
    add(labels)
    labels.freeze("first", "Ada")
    monkeypatch.setenv(PUBLIC_VARIABLE, str(ours))
    with pytest.raises(ActRefused, match="the signature does not match"):
        labels.label_set("first")
