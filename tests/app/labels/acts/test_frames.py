"""Paths and tags of frames."""

from __future__ import annotations

import pytest

from app.labels.errors import NoSuchLabel
from app.labels.store.drive_labels import DriveLabels
from tests.app.labels.acts.doing import act


def test_a_path_of_a_frame_is_drawn_drawn_again_and_removed(labels: DriveLabels) -> None:
    act(labels, kind="set_path", frame=3, left=[[0, 1.5], [20, 1.5]], right=None)
    act(labels, kind="set_path", frame=3, left=None, right=[[0, -1.5], [20, -1.5]])
    (path,) = labels.label_set().paths
    assert (path.left, path.right) == (None, ((0.0, -1.5), (20.0, -1.5)))
    act(labels, kind="remove_path", frame=3)
    assert labels.label_set().paths == ()
    with pytest.raises(NoSuchLabel):
        act(labels, kind="remove_path", frame=3)


def tags(labels: DriveLabels) -> list[tuple[int, int, str, str]]:
    return [(each.first, each.last, each.tag, each.origin.name) for each in labels.label_set().tags]


def test_a_tag_is_there_once_or_not(labels: DriveLabels) -> None:
    act(labels, kind="tag", first=3, last=3, tag="night")
    assert act(labels, kind="tag", first=3, last=3, tag="night").act is None
    assert tags(labels) == [(3, 3, "night", "Ada")]
    act(labels, kind="tag", first=3, last=3, tag="night", on=False)
    assert tags(labels) == []


def test_frames_are_tagged_and_untagged_with_one_act(labels: DriveLabels) -> None:
    """Another person's tags stay theirs; a person's adjacent tags become one range."""
    act(labels, "Bob", kind="tag", first=4, last=5, tag="night")
    done = act(labels, kind="tag", first=2, last=9, tag="night")
    assert done.what == "tagged frames 3–10 night"
    assert tags(labels) == [(2, 3, "night", "Ada"), (4, 5, "night", "Bob"), (6, 9, "night", "Ada")]
    act(labels, kind="tag", first=10, last=12, tag="night")
    act(labels, kind="tag", first=0, last=20, tag="rain")
    assert tags(labels)[-1] == (6, 12, "night", "Ada")
    assert act(labels, kind="tag", first=3, last=8, tag="night", on=False).what == "frames 4–9 are not night"
    left = [(0, 20, "rain", "Ada"), (2, 2, "night", "Ada"), (9, 12, "night", "Ada")]
    assert tags(labels) == left
    labels.log.move("undo", "Ada")
    assert [each[:2] for each in tags(labels) if each[2] == "night"] == [(2, 3), (4, 5), (6, 12)]
    labels.log.move("redo", "Ada")
    assert tags(labels) == left
    act(labels, kind="tag", first=5, last=6, tag="rain", on=False)
    assert [each[:2] for each in tags(labels) if each[2] == "rain"] == [(0, 4), (7, 20)]
