"""The rows of nuScenes' tables."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import rotation
from pipeline.formats.nuscenes_tables import AnnotationRow, SceneRow, parse_table, pose_of, truth_object
from pipeline.types.source import SourceError
from tests.pipeline.sources.made.nuscenes_on_disk import quaternion


@pytest.mark.parametrize("angles", [(0.0, 0.0, 0.0), (0.1, -0.2, 3.0), (0.0, 0.0, -1.5), (3.1, 0.0, 0.4)])
def test_a_pose_is_its_translation_and_quaternion(angles: tuple[float, float, float]) -> None:
    T = pose_of([1.0, -2.0, 3.0], quaternion(rotation(*angles)), "x")
    assert T[:3, :3] == pytest.approx(rotation(*angles), abs=1e-9)
    assert T[:, 3].tolist() == [1.0, -2.0, 3.0, 1.0]


@pytest.mark.parametrize(
    ("translation", "turn", "says"),
    [
        ([1.0, 2.0], [1.0, 0.0, 0.0, 0.0], "x: not a pose"),
        ([1.0, 2.0, 3.0], [1.0, 0.0, 0.0], "x: not a pose"),
        ([1.0, 2.0, 1e9], [1.0, 0.0, 0.0, 0.0], "x: not a pose"),
        ([1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 0.0], "x: its rotation is not a unit quaternion"),
    ],
)
def test_what_is_no_pose_is_said(translation: list[float], turn: list[float], says: str) -> None:
    with pytest.raises(SourceError, match=says):
        pose_of(translation, turn, "x")


@pytest.mark.parametrize("text", [b"", b"{}", b"[{}]", b'[{"token": 1}]', b"[" * 5000, b"\xff\xfe"])
def test_what_is_no_table_is_said(text: bytes) -> None:
    with pytest.raises(SourceError, match="x: not a table of nuScenes, or cut off"):
        parse_table(text, "x", SceneRow)


@pytest.mark.parametrize(
    ("category", "label"),
    [
        ("vehicle.car", "car"),
        ("vehicle.bus.rigid", "bus"),
        ("vehicle.construction", "truck"),
        ("human.pedestrian.adult", "person"),
        ("vehicle.bicycle", "bicycle"),
        ("movable_object.barrier", "barrier"),
    ],
)
def test_categories_are_classes_that_detectors_know(category: str, label: str) -> None:
    box = AnnotationRow("s", "i", [10.0, 0.0, 1.0], [1.8, 4.5, 1.5], [1.0, 0.0, 0.0, 0.0])
    found = truth_object(box, category, 7, np.eye(4))
    assert found is not None
    assert (found.label, found.called, found.id, found.cuboid.size) == (label, category, 7, (4.5, 1.8, 1.5))


def test_a_box_without_a_size_is_left_out() -> None:
    box = AnnotationRow("s", "i", [10.0, 0.0, 1.0], [0.0, 4.5, 1.5], [1.0, 0.0, 0.0, 0.0])
    assert truth_object(box, "vehicle.car", 7, np.eye(4)) is None
