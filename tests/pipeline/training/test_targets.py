"""Cells that answer for a box say it back through the decoder of the product."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.training.targets import BACKGROUND, IGNORED, assign
from pipeline.vision.heads.decoder import grid_centres
from pipeline.vision.heads.yolox import decode_yolox

SIZE = (192, 320)
CAR = np.array([[100.0, 60.0, 130.0, 84.0]], dtype=np.float32)


def _assign(boxes: np.ndarray, labels: list[int], visible: list[float]):  # type: ignore[no-untyped-def]
    return assign(boxes, np.array(labels), np.array(visible, dtype=np.float32), SIZE)


@pytest.mark.parametrize(
    ("box", "strides"),
    [
        ((100, 60, 112, 70), {8}),
        ((100, 60, 150, 108), {8, 16}),
        ((60, 20, 140, 100), {16}),
        ((10, 5, 300, 180), {32}),
    ],
)
def test_a_box_belongs_to_the_strides_of_its_size(box: tuple[float, ...], strides: set[int]) -> None:
    targets = _assign(np.array([box], dtype=np.float32), [1], [1.0])
    steps = grid_centres(SIZE)[1][:, 0]
    assert set(steps[targets.labels == 1].astype(int).tolist()) == strides


def test_what_the_cells_should_say_is_decoded_to_the_box() -> None:
    targets = _assign(CAR, [2], [1.0])
    cells, strides = grid_centres(SIZE)
    rows = np.zeros((1, len(cells), 9), dtype=np.float32)
    mine = targets.labels == 2
    box = targets.boxes[mine]
    rows[0, mine, :2] = (box[:, :2] + box[:, 2:]) / 2 / strides[mine] - cells[mine]
    rows[0, mine, 2:4] = np.log((box[:, 2:] - box[:, :2]) / strides[mine])
    rows[0, mine, 4], rows[0, mine, 7] = 1.0, 1.0
    boxes, scores, classes = decode_yolox([rows], SIZE, 0.5)
    assert len(boxes) == mine.sum() >= 1
    np.testing.assert_allclose(boxes, np.repeat(CAR, len(boxes), axis=0), atol=1e-3)
    assert (set(scores.tolist()), set(classes.tolist())) == ({1.0}, {2})


@pytest.mark.parametrize(
    ("visible", "height", "said"), [(0.9, 24.0, 0), (0.15, 24.0, IGNORED), (0.9, 4.0, IGNORED), (0.01, 24.0, None)]
)
def test_the_barely_visible_is_not_asked_for(visible: float, height: float, said: int | None) -> None:
    box = CAR.copy()
    box[0, 3] = box[0, 1] + height
    labels = set(_assign(box, [0], [visible]).labels.tolist())
    assert labels == ({BACKGROUND} if said is None else {BACKGROUND, said})


def test_of_two_boxes_in_one_place_the_visible_one_is_learned() -> None:
    both = np.concatenate([CAR, CAR])
    for labels, visible in (([0, 1], [0.4, 1.0]), ([1, 0], [1.0, 0.4])):
        assert 0 not in set(_assign(both, labels, visible).labels.tolist()) - {BACKGROUND}
