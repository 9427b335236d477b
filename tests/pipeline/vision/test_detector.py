from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.inference.graph import fitting_size
from pipeline.inference.model_registry import register
from pipeline.inference.runtime import DetectorError, DetectorMissing
from pipeline.params import DetectionParams
from pipeline.vision.detector import FLOOR_SCORE, open_detector
from pipeline.vision.nms import select
from tests.pipeline.vision import networks


@pytest.fixture(autouse=True)
def _no_installed_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("CIPV_DATA", str(tmp_path / "data"))


def _road(height: int, width: int, lamp: tuple[int, int]) -> np.ndarray:
    """A black image with one bright patch of 16×16 pixels, its upper left corner at ``lamp`` x, y."""
    image = np.zeros((height, width, 3), np.uint8)
    image[lamp[1] : lamp[1] + 16, lamp[0] : lamp[0] + 16] = 255
    return image


@pytest.mark.parametrize(
    ("image", "own", "expected"),
    [
        ((2048, 618), (416, 416), (256, 832)),
        ((1242, 375), (416, 416), (256, 832)),
        ((1280, 720), (416, 416), (384, 640)),
        ((1280, 720), (640, 640), (480, 832)),
        ((100, 60), (416, 416), (96, 128)),
        ((720, 1280), None, (640, 352)),
    ],
)
def test_input_size_follows_the_image(
    image: tuple[int, int], own: tuple[int, int] | None, expected: tuple[int, int]
) -> None:
    assert fitting_size(image, own) == expected


@pytest.mark.parametrize("size", [(64, 64), ("height", "width")], ids=["fixed", "free"])
def test_a_bright_patch_is_found_where_it_is(tmp_path: Path, size: tuple[int | str, int | str]) -> None:
    """The image is 512×128 and the input 256×64 or larger: boxes come back in image pixels."""
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx", size)), (512, 128))
    assert detector.input_size == (128, 512)
    raw = detector.detect(_road(128, 512, (320, 64)))
    assert raw.labels[0] == "car"
    assert raw.scores[0] == pytest.approx(1.0)
    centre = (raw.boxes[0, :2] + raw.boxes[0, 2:]) / 2
    assert np.all(np.abs(centre - (328, 72)) <= 8)
    assert raw.model == detector.name
    assert (np.diff(raw.scores) <= 0).all()
    assert raw.scores.min() >= FLOOR_SCORE


def test_boxes_are_scaled_back_to_the_image(tmp_path: Path) -> None:
    path = str(networks.yolox(tmp_path / "tiny.onnx"))
    raw = open_detector(path, None, input_size=(64, 128)).detect(_road(256, 512, (256, 128)))
    centre = (raw.boxes[0, :2] + raw.boxes[0, 2:]) / 2
    assert np.all(np.abs(centre - (264, 136)) <= 32)
    assert raw.boxes[:, 0::2].max() <= 512
    assert raw.boxes[:, 1::2].max() <= 256
    assert raw.boxes.min() >= 0


def test_a_graph_that_holds_its_size_keeps_it_and_says_so(tmp_path: Path) -> None:
    path = str(networks.yolox(tmp_path / "tiny.onnx", baked_size=True))
    detector = open_detector(path, (512, 128))
    assert detector.input_size == (64, 64)
    assert "only at its own input size 64×64" in detector.notes[0]
    with pytest.raises(DetectorError, match="network failed"):
        open_detector(path, None, input_size=(64, 128))


def test_a_constant_grid_of_equal_cell_count_is_refused(tmp_path: Path) -> None:
    """32×128 has as many pixels as 64×64, so such a graph runs without complaint, on the wrong grid."""
    path = str(networks.yolov8(tmp_path / "v8.onnx"))
    with pytest.raises(DetectorError, match="graph may contain a grid"):
        open_detector(path, None, input_size=(32, 128))


def test_v8_gets_rgb_between_0_and_1_and_names_its_classes(tmp_path: Path) -> None:
    detector = open_detector(str(networks.yolov8(tmp_path / "v8.onnx")), None)
    assert (detector.head, detector.labels) == ("yolov8", ("person", "truck"))
    red = np.zeros((64, 64, 3), np.uint8)
    red[..., 2] = 204
    raw = detector.detect(red)
    assert raw.labels == ("truck",)
    assert raw.scores[0] == pytest.approx(0.8, abs=1e-5)
    np.testing.assert_allclose(raw.boxes, [[0, 0, 64, 64]])
    assert len(detector.detect(red[..., ::-1].copy()).scores) == 0


def test_a_detr_gives_boxes_in_the_images_pixels(tmp_path: Path) -> None:
    detector = open_detector(str(networks.detr(tmp_path / "detr.onnx")), None)
    assert (detector.head, detector.input_size) == ("DETR", (64, 64))
    red = np.zeros((256, 256, 3), np.uint8)
    red[..., 2] = 204
    raw = detector.detect(red)
    assert raw.labels == ("car", "person")
    assert raw.scores.tolist() == pytest.approx([0.8, 0.8], abs=1e-5)
    np.testing.assert_allclose(raw.boxes, [[0, 0, 128, 128], [192, 0, 256, 256]])


def test_the_rest_of_the_input_is_grey(tmp_path: Path) -> None:
    """With a black image that fills a quarter of the input, the mean is three quarters of 114."""
    detector = open_detector(str(networks.yolov8(tmp_path / "v8.onnx")), None)
    raw = detector.detect(np.zeros((16, 64, 3), np.uint8))
    assert raw.scores[0] == pytest.approx(0.75 * 114 / 255, abs=1e-5)


def test_equal_files_and_sizes_have_equal_names(tmp_path: Path) -> None:
    path = str(networks.yolox(tmp_path / "tiny.onnx"))
    names = {open_detector(path, None, input_size=size).name for size in [(64, 64), (64, 64), (64, 128)]}
    (tmp_path / "other").mkdir()
    names.add(open_detector(str(networks.yolox(tmp_path / "other" / "tiny.onnx", (64, 128))), None).name)
    assert len(names) == 3


def test_the_same_image_gives_the_same_bytes(tmp_path: Path) -> None:
    path, image = str(networks.yolox(tmp_path / "tiny.onnx")), _road(128, 512, (320, 64))
    first, second = (open_detector(path, (512, 128)).detect(image) for _ in range(2))
    assert first.boxes.tobytes() == second.boxes.tobytes()
    assert first.scores.tobytes() == second.scores.tobytes()


def test_without_a_network_the_remedy_is_named() -> None:
    with pytest.raises(DetectorMissing, match=r"cipv models pull yolox_nano.*--detector PATH"):
        open_detector("nothing-here", (1280, 720))


def test_with_no_other_network_the_embedded_one_is_used_and_says_what_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("CIPV_HOME", "CIPV_DATA"):
        monkeypatch.setenv(variable, str(tmp_path / variable))
    fallen_back, named = (open_detector(spec, (1280, 720)) for spec in (None, "embedded"))
    assert fallen_back.name == named.name
    assert fallen_back.labels == ("car", "truck", "bus", "motorcycle")
    assert "simulated cars only" in fallen_back.notes[0]
    assert "cipv models pull yolox_nano" in fallen_back.notes[0]
    assert named.notes == ()
    register(networks.yolox(tmp_path / "mine.onnx"), "mine")
    assert open_detector(None, (1280, 720)).notes == ()


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda path: path.write_bytes(b"not a network") and path, "is not an ONNX file"),
        (networks.classifier, "no YOLO head has outputs of shape 1×3×1×1"),
    ],
    ids=["not ONNX", "not a detector"],
)
def test_what_is_no_detector_is_refused_in_a_sentence(tmp_path: Path, make, complaint: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DetectorError, match=complaint):
        open_detector(str(make(tmp_path / "odd.onnx")), (1280, 720))


@pytest.mark.parametrize("size", [(0, 64), (64, 100)])
def test_an_impossible_input_size_is_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(DetectorError, match="multiples of 32"):
        open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), None, input_size=size)


@pytest.mark.parametrize(
    "image",
    [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.float32), np.zeros((0, 4, 3), np.uint8)],
    ids=["grey", "float", "empty"],
)
def test_what_is_no_image_is_refused(tmp_path: Path, image: np.ndarray) -> None:
    detector = open_detector(str(networks.yolox(tmp_path / "tiny.onnx")), None)
    with pytest.raises(DetectorError, match="expected an image"):
        detector.detect(image)


def test_the_real_network_finds_the_real_lead(data_dir: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIPV_DATA", str(data_dir))
    image = cv2.imread(str(data_dir / "kitti_0052" / "image_02" / "0000000007.png"))
    detector = open_detector(None, (image.shape[1], image.shape[0]))
    assert detector.input_size == (256, 832)
    assert detector.notes == ()
    best = select(detector.detect(image), DetectionParams())[0]
    assert best.label == "car"
    np.testing.assert_allclose(best.bbox, (556, 185, 714, 335), atol=8)  # the recording's own label
