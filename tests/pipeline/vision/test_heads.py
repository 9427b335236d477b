"""Every head is encoded from known boxes by the inverse of its definition, and must give them back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from pipeline.vision import heads
from pipeline.vision.heads import UnknownHead, pick_decoder
from pipeline.vision.heads.anchor_maps import ANCHORS
from pipeline.vision.heads.decoder import BoxOutputs, Decoded, Decoder, Head

SIZE = (64, 96)
CELLS = 8 * 12 + 4 * 6 + 2 * 3
TRUE_BOXES = np.array([[10.0, 12.0, 30.0, 28.0], [40.0, 5.0, 90.0, 60.0]])
TRUE_CLASSES = np.array([2, 0])
SCORES = np.array([0.9, 0.6])
CLASSES = 5
FLOOR = 0.05


def _centre_size() -> np.ndarray:
    return np.column_stack([(TRUE_BOXES[:, :2] + TRUE_BOXES[:, 2:]) / 2, TRUE_BOXES[:, 2:] - TRUE_BOXES[:, :2]])


def _logit(p: np.ndarray | float) -> np.ndarray:
    p = np.asarray(p, dtype=np.float64)
    return np.log(p / (1.0 - p))


def _class_rows(objectness: bool) -> np.ndarray:
    """Score s = objectness × probability; without objectness the probability alone."""
    rows = np.zeros((2, CLASSES))
    rows[[0, 1], TRUE_CLASSES] = np.sqrt(SCORES) if objectness else SCORES
    return np.column_stack([np.sqrt(SCORES), rows]) if objectness else rows


def _yolox() -> list[np.ndarray]:
    out = np.zeros((1, CELLS, 5 + CLASSES), np.float32)
    start = 0
    for stride in (8, 16, 32):
        rows, columns = SIZE[0] // stride, SIZE[1] // stride
        if stride == 16:  # both objects on the middle map
            for box, scores in zip(_centre_size(), _class_rows(True), strict=True):
                i, j = int(box[1] // stride), int(box[0] // stride)
                offset = box[:2] / stride - [j, i]
                out[0, start + i * columns + j] = [*offset, *np.log(box[2:] / stride), *scores]
        start += rows * columns
    return [out]


def _rows_with_objectness(count: int) -> list[np.ndarray]:
    out = np.zeros((1, count, 5 + CLASSES), np.float32)
    out[0, :, :2] = 40.0  # centres of what scores nothing lie in the image, as in a real output
    out[0, [7, 20]] = np.column_stack([_centre_size(), _class_rows(True)])
    return [out]


def _yolov6() -> list[np.ndarray]:
    out = np.zeros((1, CELLS, 5 + CLASSES), np.float32)
    out[0, :, :2], out[0, :, 4] = 40.0, 1.0
    out[0, [7, 20], :4] = _centre_size()
    out[0, [7, 20], 5:] = _class_rows(False)
    return [out]


def _yolov8() -> list[np.ndarray]:
    out = np.zeros((1, 4 + CLASSES, CELLS), np.float32)
    out[0][:, [7, 20]] = np.column_stack([_centre_size(), _class_rows(False)]).T
    return [out]


def _end_to_end() -> list[np.ndarray]:
    out = np.zeros((1, 300, 6), np.float32)
    out[0, :2] = np.column_stack([TRUE_BOXES, SCORES, TRUE_CLASSES])
    return [out]


def _maps(version: int) -> list[np.ndarray]:
    """Both objects on the stride-16 map, at their second anchor; maps given coarsest first."""
    maps = []
    for stride in (32, 16, 8):
        grid = np.full((3, SIZE[0] // stride, SIZE[1] // stride, 5 + CLASSES), -30.0)
        if stride == 16:
            anchor = np.array(ANCHORS[16][1])
            for box, scores in zip(_centre_size(), _class_rows(True), strict=True):
                i, j = int(box[1] // stride), int(box[0] // stride)
                offset, size = box[:2] / stride - [j, i], box[2:] / anchor
                t_xy = _logit(offset) if version == 3 else _logit((offset + 0.5) / 2)
                t_wh = np.log(size) if version == 3 else _logit(np.sqrt(size) / 2)
                grid[1, i, j] = [*t_xy, *t_wh, *_logit(np.clip(scores, 1e-9, 1 - 1e-9))]
        if version == 3:
            grid = grid.transpose(0, 3, 1, 2).reshape(-1, *grid.shape[1:3])
        maps.append(grid[None].astype(np.float32))
    return maps


HEADS = {
    "yolox": (_yolox(), {}, False, 1.0),
    "yolox decoded": (_rows_with_objectness(CELLS), {}, False, 1.0),
    "yolov5": (_rows_with_objectness(3 * CELLS), {}, True, 1 / 255),
    "yolov6": (_yolov6(), {}, True, 1 / 255),
    "yolov8": (_yolov8(), {}, True, 1 / 255),
    "end to end": (_end_to_end(), {"end2end": "True"}, True, 1 / 255),
    "yolov3 maps": (_maps(3), {}, True, 1 / 255),
    "yolov5 maps": (_maps(5), {}, True, 1 / 255),
}


@pytest.mark.parametrize("name", HEADS)
def test_known_boxes_come_back(name: str) -> None:
    outputs, metadata, rgb, scale = HEADS[name]
    decoder = pick_decoder(outputs, SIZE, metadata)
    assert (decoder.name, decoder.rgb, decoder.scale) == (name, rgb, scale)
    assert decoder.classes in (CLASSES, 0)
    boxes, scores, classes = decoder.decode(outputs, SIZE, FLOOR)
    order = np.argsort(-scores)
    np.testing.assert_allclose(boxes[order], TRUE_BOXES, atol=1e-3)
    np.testing.assert_allclose(scores[order], SCORES, rtol=1e-4)
    assert classes[order].tolist() == TRUE_CLASSES.tolist()
    assert (boxes.dtype, scores.dtype, classes.dtype) == (np.float32, np.float32, np.int64)


@pytest.mark.parametrize("name", HEADS)
def test_nothing_above_the_floor_is_empty(name: str) -> None:
    outputs, metadata, *_ = HEADS[name]
    boxes, scores, classes = pick_decoder(outputs, SIZE, metadata).decode(outputs, SIZE, 0.95)
    assert boxes.shape == (0, 4)
    assert scores.shape == (0,)
    assert classes.shape == (0,)


@pytest.mark.parametrize("name", HEADS)
def test_what_is_not_finite_is_no_candidate(name: str) -> None:
    outputs, metadata, *_ = HEADS[name]
    decoder = pick_decoder(outputs, SIZE, metadata)
    broken = [np.full_like(output, np.nan) for output in outputs]
    assert len(decoder.decode(broken, SIZE, FLOOR)[0]) == 0


def test_maps_may_come_in_any_order() -> None:
    forward, backward = _maps(3), _maps(3)[::-1]
    decoder = pick_decoder(backward, SIZE)
    np.testing.assert_array_equal(decoder.decode(forward, SIZE, FLOOR)[0], decoder.decode(backward, SIZE, FLOOR)[0])


@pytest.mark.parametrize(
    "shapes",
    [[], [(1, 1000)], [(1, 2, 64, 96)], [(2, CELLS, 85)], [(1, CELLS + 1, 85)], [(1, 30, 1, 1), (1, 30, 2, 3)]],
    ids=str,
)
def test_an_unknown_head_is_named_by_its_shapes(shapes: list[tuple[int, ...]]) -> None:
    with pytest.raises(UnknownHead) as caught:
        pick_decoder([np.zeros(shape, np.float32) for shape in shapes], SIZE)
    for shape in shapes:
        assert "×".join(map(str, shape)) in str(caught.value)


def _corners_first(outputs: Sequence[np.ndarray], size: tuple[int, int], floor: float) -> Decoded:
    rows = outputs[0]
    return rows[:, :4], rows[:, 4], rows[:, 5].astype(np.int64)


def _recognise(answer: BoxOutputs) -> Decoder | None:
    one_table = len(answer.outputs) == 1 and answer.outputs[0].ndim == 2
    return Decoder("tables", 5, True, 1.0, True, _corners_first) if one_table else None


def test_a_head_is_added_by_a_file_and_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """The two functions above are all that a new form of output needs."""
    table = np.array([[1.0, 2.0, 3.0, 4.0, 0.9, 2.0]], np.float32)
    with pytest.raises(UnknownHead):
        pick_decoder([table], SIZE)
    monkeypatch.setattr(heads, "HEADS", (*heads.HEADS, Head("Tables", _recognise)))
    decoder = pick_decoder([table], SIZE)
    boxes, _, classes = decoder.decode([table], SIZE, FLOOR)
    assert (decoder.name, boxes.tolist(), classes.tolist()) == ("tables", [[1.0, 2.0, 3.0, 4.0]], [2])
    with pytest.raises(UnknownHead, match=r"known are YOLOv3, .*Tables"):
        pick_decoder([], SIZE)
    for name, (outputs, metadata, *_) in HEADS.items():
        assert pick_decoder(outputs, SIZE, metadata).name == name, "the others stay"
