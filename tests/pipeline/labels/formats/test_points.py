"""Points in cuboids are those that lie in them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.geometry import Cuboid
from pipeline.labels.formats.base import FrameInfo, LabeledDrive
from pipeline.labels.formats.points import count_inside, points_inside
from pipeline.labels.model import LabelSet, LabelTrack, Sighting
from pipeline.types import F32
from tests.pipeline.labels.formats.sets import IMPORT


def in_turn(points: F32, cuboid: Cuboid) -> int:
    """The same count, point by point in the cuboid's frame."""
    c, s = np.cos(cuboid.yaw_rad), np.sin(cuboid.yaw_rad)
    offset = points[:, :3].astype(np.float64) - cuboid.center
    along, across = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    own = np.abs(np.column_stack([along, across, offset[:, 2]]))
    return int(np.all(own <= np.array(cuboid.size) / 2, axis=1).sum())


@pytest.mark.parametrize("seed", range(5))
def test_counts_are_those_of_each_point_in_turn(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-15.0, 15.0, (4000, 4)).astype(np.float32)
    cuboids = [
        Cuboid(tuple(random.uniform(-15.0, 15.0, 3)), tuple(random.uniform(0.5, 12.0, 3)), random.uniform(-7.0, 7.0))
        for _ in range(20)
    ]
    counts = count_inside(points, cuboids)
    assert counts.tolist() == [in_turn(points, cuboid) for cuboid in cuboids]
    assert counts.max() > 0


def test_a_point_on_a_face_is_inside_and_one_in_two_cuboids_counts_in_both() -> None:
    points = np.array([(2.0, 0.0, 0.0), (0.0, 1.0, 0.5), (2.001, 0.0, 0.0)], dtype=np.float32)
    cuboids = [Cuboid((0.0, 0.0, 0.0), (4.0, 2.0, 1.0), 0.0), Cuboid((1.0, 0.0, 0.0), (2.0, 2.0, 1.0), 0.0)]
    assert count_inside(points, cuboids).tolist() == [2, 2]


def test_no_cuboid_and_no_point() -> None:
    assert count_inside(np.zeros((3, 4), dtype=np.float32), []).tolist() == []
    assert count_inside(np.zeros((0, 4), dtype=np.float32), [Cuboid((0, 0, 0), (1, 1, 1), 0.0)]).tolist() == [0]


def test_every_frame_is_counted_with_its_own_points() -> None:
    """More frames than one reader takes at once; every third one is without LiDAR, every fifth without a cuboid."""
    count = 50
    cuboid = Cuboid((10.0, 0.0, 0.0), (4.0, 2.0, 1.5), 0.0)

    def points(index: int) -> F32 | None:
        return None if index % 3 == 0 else np.tile(np.array([[10.0, 0.0, 0.0, 1.0]], dtype=np.float32), (index, 1))

    seen = tuple(Sighting(index, None if index % 5 == 0 else cuboid, (0.0, 0.0, 9.0, 9.0)) for index in range(count))
    shots = tuple(FrameInfo(f"{index:06d}", index * 10**8) for index in range(count))
    labels = LabelSet("test:drive", (), (), (LabelTrack(7, "car", seen, "accepted", IMPORT),))
    found = points_inside(labels, LabeledDrive("test:drive", shots, points))
    assert found == {(7, index): index for index in range(count) if index % 3 and index % 5}
