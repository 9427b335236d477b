"""The second look: where its window is, what it finds there, and what becomes of the boxes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.detection import Detectors, detect
from pipeline.live_detection import CALM_TICKS, LiveDetectors
from pipeline.params import DetectionParams
from pipeline.types import CameraCalibration, CameraImage, EgoState, Frame, RawBoxes
from pipeline.vision.detector import open_detector
from pipeline.vision.far_view import FarView, open_far_view, window_of
from pipeline.vision.nms import select
from tests.pipeline.vision import networks

WIDE = (2048, 618)
T_CAMERA_EGO = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def camera(cx: float = 1010.0, cy: float = 300.0) -> CameraCalibration:
    K = np.array([[1800.0, 0.0, cx], [0.0, 1800.0, cy], [0.0, 0.0, 1.0]])
    return CameraCalibration(K, np.zeros(5), T_CAMERA_EGO, *WIDE)


def frame(ego: EgoState | None = None, seen_by: CameraCalibration | None = None) -> Frame:
    return Frame(0, "0", 0, camera=seen_by, ego=ego)


@pytest.mark.parametrize(
    ("case", "of", "expected"),
    [
        ("no camera: the middle of the image", None, (816, 96, 1232, 512)),
        ("around the vanishing point", frame(None, camera()), (800, 96, 1216, 512)),
        ("at the image's edge it stays inside", frame(None, camera(2000.0, 20.0)), (1632, 0, 2048, 416)),
        ("a bend to the left of 200 m", frame(EgoState(0, 20.0, 0.1), camera()), (528, 96, 944, 512)),
        ("the same to the right", frame(EgoState(0, 20.0, -0.1), camera()), (1072, 96, 1488, 512)),
        ("noise of the yaw rate", frame(EgoState(0, 20.0, 0.001), camera()), (800, 96, 1216, 512)),
        ("nearly at rest", frame(EgoState(0, 0.5, 0.1), camera()), (800, 96, 1216, 512)),
        ("speed without a yaw rate", frame(EgoState(0, 20.0), camera()), (800, 96, 1216, 512)),
    ],
)
def test_the_window_is_where_the_road_goes(case: str, of: Frame | None, expected: tuple[int, int, int, int]) -> None:
    assert window_of(of, WIDE) == expected, case


def test_an_image_smaller_than_the_window_is_seen_whole() -> None:
    assert window_of(None, (300, 200)) == (0, 0, 300, 200)


@pytest.fixture(scope="module")
def far(tmp_path_factory: pytest.TempPathFactory) -> FarView:
    path = networks.yolox(tmp_path_factory.mktemp("far") / "tiny.onnx", ("height", "width"))
    view = open_far_view(open_detector(str(path), WIDE), WIDE, 256)
    assert view is not None
    return view


def bright_at(*patches: tuple[int, int]) -> np.ndarray:
    image = np.zeros((WIDE[1], WIDE[0], 3), np.uint8)
    for u, v in patches:
        image[v : v + 16, u : u + 16] = 255
    return image


def test_a_patch_too_small_for_the_whole_image_is_found_where_it_is(far: FarView) -> None:
    seen = far.of(None).detect(bright_at((1000, 300)))
    assert seen.scores[0] == pytest.approx(1.0, abs=0.01)
    centre = (seen.boxes[0, :2] + seen.boxes[0, 2:]) / 2
    assert np.all(np.abs(centre - (1008, 308)) <= 8)
    assert seen.far == window_of(None, WIDE, 256)
    assert seen.far_count == len(seen.boxes)


def test_what_the_window_cuts_off_is_left_to_the_whole_image(far: FarView) -> None:
    x1, y1, _, _ = window_of(None, WIDE, 256)
    seen = far.of(None).detect(bright_at((x1 - 8, y1 + 100)))
    assert not len(seen.boxes) or seen.boxes[:, 0].min() >= x1 + 3


def test_no_second_look_where_the_first_is_native(tmp_path: Path) -> None:
    path = networks.yolox(tmp_path / "tiny.onnx", ("height", "width"))
    assert open_far_view(open_detector(str(path), (256, 128)), (256, 128)) is None


def test_a_network_of_one_size_looks_at_its_own(tmp_path: Path) -> None:
    path = networks.yolox(tmp_path / "tiny.onnx", baked_size=True)
    view = open_far_view(open_detector(str(path), WIDE), WIDE)
    assert view is not None
    assert view.of(None).detect(bright_at((1000, 300))).far == window_of(None, WIDE)


def raw(boxes: list[list[float]], scores: list[float]) -> RawBoxes:
    return RawBoxes("n", np.array(boxes, np.float32), np.array(scores, np.float32), ("car",) * len(boxes))


class Answers:
    """Returns the same boxes for every image, and counts its calls."""

    notes: tuple[str, ...] = ()

    def __init__(self, name: str, answer: RawBoxes) -> None:
        self.name, self.answer, self.calls = name, answer, 0

    def detect(self, bgr: np.ndarray) -> RawBoxes:
        self.calls += 1
        return self.answer


def test_both_looks_at_one_car_are_one_detection_and_the_parameter_takes_one_back() -> None:
    whole = Answers("whole", raw([[900, 250, 1000, 330], [100, 300, 300, 500]], [0.5, 0.9]))
    native = Answers("native", raw([[85, 155, 184, 233], [200, 190, 220, 206]], [0.8, 0.7]))
    taken = Frame(0, "0", 0, image=CameraImage(0, bright_at()))
    seen = detect(taken, Detectors(whole, far=FarView(native)))
    assert seen.raw_boxes is not None
    found = select(seen.raw_boxes, DetectionParams())
    assert sorted((round(each.score, 1), round(each.bbox[0])) for each in found) == [
        (0.7, 1016),
        (0.8, 901),
        (0.9, 100),
    ]
    assert select(seen.raw_boxes, DetectionParams(far_view=False)) == select(whole.answer, DetectionParams())


@pytest.mark.parametrize(
    ("case", "box", "is_kept"),
    [
        ("wide, and nowhere in the whole image: the empty road taken for a car", [10, 190, 400, 320], False),
        ("wide, and in the whole image, too, with any score", [85, 155, 184, 233], True),
        ("narrow: too small for the whole image", [200, 190, 220, 206], True),
    ],
)
def test_a_large_vehicle_must_be_in_the_whole_image_too(case: str, box: list[float], is_kept: bool) -> None:
    x1, y1, _, _ = window_of(None, WIDE)
    whole = Answers("whole", raw([[x1 + 90, y1 + 150, x1 + 190, y1 + 230]], [0.06]))
    view = FarView(Answers("native", raw([box, [300, 100, 310, 108]], [0.8, 0.7])), sure_px=90.0)
    seen = detect(Frame(0, "0", 0, image=CameraImage(0, bright_at())), Detectors(whole, far=view)).raw_boxes
    assert seen is not None
    assert seen.without_far().boxes.tolist() == whole.answer.boxes.tolist(), case
    in_window = (seen.boxes[1:] - [x1, y1, x1, y1]).tolist()
    assert in_window == ([box, [300, 100, 310, 108]] if is_kept else [[300, 100, 310, 108]]), case


def test_what_the_whole_image_cannot_miss_depends_on_its_scale(far: FarView) -> None:
    assert far.sure_px == pytest.approx(50 * WIDE[0] / 832, rel=0.01), "the input's width for this image is 832"


def test_every_nth_frame_by_its_index() -> None:
    native = Answers("native", raw([[85, 155, 184, 233]], [0.8]))
    asked = Detectors(Answers("whole", raw([[1, 1, 2, 2]], [0.1])), far=FarView(native), far_every=2)
    image = CameraImage(0, bright_at())
    seen = [detect(Frame(k, str(k), k, image=image), asked).raw_boxes for k in range(4)]
    assert [boxes is not None and boxes.far is not None for boxes in seen] == [True, False, True, False]


def test_where_ticks_are_dropped_the_far_view_sits_out_every_other_one() -> None:
    asked = LiveDetectors(Detectors(far=FarView(Answers("native", raw([[1, 1, 2, 2]], [0.1])))))
    tick = Frame(0, "0", 0, image=CameraImage(0, bright_at()))
    looked = [asked.of(replace(tick, index=index))[1].far is not None for index in (0, 1, 2, 4, 5, 6, 7, 9, 10)]
    assert looked == [True, True, True, False, True, False, True, False, True]
    for index, notes in ((11, 1), (12, 0), (13, 1)):
        assert len(detect(*asked.of(replace(tick, index=index))).notes) == notes, "the result says what was left out"
    calm = [asked.of(replace(tick, index=index))[1].far is not None for index in range(14, 14 + 2 * CALM_TICKS)]
    assert all(calm[CALM_TICKS:]), "once nothing is dropped for a while, every tick again"
