"""Lane networks of every kind, run for real, on images whose red and green are the lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.inference import model_registry
from pipeline.inference.runtime import DetectorError, DetectorMissing
from pipeline.lanes import heads
from pipeline.lanes.classical import ClassicalLanes
from pipeline.lanes.heads import UnknownLaneHead, pick_head
from pipeline.lanes.heads.head import LaneHead, LaneOutputs, Points
from pipeline.lanes.network import LaneNetwork, open_lane_network
from pipeline.lanes.open_detector import OFF, open_lanes
from pipeline.types import U8, CameraCalibration
from pipeline.types.detections import ROAD_LEFT, ROAD_RIGHT
from tests.pipeline.lanes import lane_networks
from tests.pipeline.lanes.lane_cameras import camera_of
from tests.pipeline.vision import networks

RED, GREEN, BLUE = (0, 0, 255), (0, 255, 0), (255, 0, 0)
WIDTH, HEIGHT = 1280, 720


@pytest.fixture(autouse=True)
def _own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("CIPV_HOME", "CIPV_DATA"):
        monkeypatch.setenv(variable, str(tmp_path / variable))


def image(**bars: tuple[int, int]) -> U8:
    """Black, with upright bars: ``red=(left, right)`` columns."""
    bgr = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for name, (left, right) in bars.items():
        bgr[:, left:right] = {"red": RED, "green": GREEN, "blue": BLUE}[name]
    return bgr


def level_camera(horizon: float, width: int = WIDTH, height: int = HEIGHT) -> CameraCalibration:
    """Looks straight ahead, with the horizon at this share of the image's height."""
    return camera_of(1000.0, width, height, (width / 2, horizon * height))


MASKS = {
    "two masks": (lane_networks.twin, (72, 128), "two masks"),
    "two masks of free size": (lane_networks.twin, ("h", "w"), "two masks"),
    "YOLOP, letterboxed": (lane_networks.yolop, (128, 128), "YOLOP"),
    "YOLOP, upright": (lane_networks.yolop, (256, 128), "YOLOP"),
    "classes": (lane_networks.classes, (72, 128), "classes"),
    "classes of the lower part": (lane_networks.classes, (52, 244), "classes"),
}


def test_curves_lie_in_the_image_whose_sky_was_cut_off_at_the_cameras_horizon(tmp_path: Path) -> None:
    """The curve begins in the middle of the input: 0.33 of it lie above the horizon, and 17 % down to that."""
    network = open_lane_network(str(lane_networks.lstr(tmp_path / "lstr.onnx")), camera=level_camera(0.57))
    assert network.head.name == "LSTR"
    raw = network.detect(image())
    assert set(raw.line.tolist()) == {0}
    assert raw.points[:, 0] == pytest.approx(639.5, abs=1.0)
    sky = (0.57 - 0.33) / (1.0 - 0.33)
    assert raw.points[:, 1].min() == pytest.approx((sky + 0.5 * (1.0 - sky)) * HEIGHT, abs=2.0)
    assert raw.points[:, 1].max() == pytest.approx(HEIGHT, abs=5.0)


def test_a_network_for_another_camera_is_the_one_that_is_opened_for_it(tmp_path: Path) -> None:
    low, high = level_camera(0.4), level_camera(0.57)
    file = str(lane_networks.lstr(tmp_path / "lstr.onnx"))
    turned, opened = open_lane_network(file, camera=low).of_camera(high), open_lane_network(file, camera=high)
    assert turned == opened
    assert np.array_equal(turned.detect(image()).points, opened.detect(image()).points)
    assert turned.name != open_lane_network(file, camera=low).name


@pytest.mark.parametrize(
    ("width", "height", "horizon", "rows"),
    [(1280, 720, 0.57, 200), (1242, 375, 0.48, 128), (2048, 618, 0.63, 88), (1280, 720, 0.1, 360), (640, 96, 0.5, 64)],
)
def test_a_fully_convolutional_network_sees_the_road_in_its_own_aspect(
    tmp_path: Path, width: int, height: int, horizon: float, rows: int
) -> None:
    """Its attention, which is exported for one size of map, is reduced with it."""
    file = str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640), attention=True))
    network = open_lane_network(file, camera=level_camera(horizon, width, height))
    assert network.input_size == (rows, 640)
    bgr = np.zeros((height, width, 3), np.uint8)
    bgr[:, width // 2 : width // 2 + 20] = RED
    raw = network.detect(bgr)
    assert raw.points[:, 0] == pytest.approx(width // 2 + 9.5, abs=3.0)
    sky = min(max((horizon - 0.22) / 0.78, 0.0), 0.6)
    assert raw.points[:, 1].min() == pytest.approx(sky * height, abs=height / rows + 1.0)
    assert raw.points[:, 1].max() == pytest.approx(height, abs=2.0 * height / rows + 1.0)
    assert open_lane_network(file).of_camera(level_camera(horizon, width, height)).input_size == (rows, 640)
    assert open_lane_network(file, camera=level_camera(0.3)).name != network.name


def test_the_far_part_of_an_image_is_seen_at_twice_the_scale_in_the_images_pixels(tmp_path: Path) -> None:
    """A line that is two pixels wide, and ends half way down, is where it is in the image. So is the edge of the road,
    while what leaves the window on its left ends nowhere."""
    wide = camera_of(721.5, 1242, 375, (610.0, 173.0))
    whole = open_lane_network(str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640), attention=True)), camera=wide)
    far = whole.far_of(wide)
    assert far is not None
    assert far.window == (290, 145, 931, 273)
    assert far.input_size == (128, 640)
    assert whole.input_size == (136, 640), "it costs as much"
    bgr = np.zeros((375, 1242, 3), np.uint8)
    bgr[180:230, 700:702] = RED
    line = far.detect(bgr).painted().points
    assert line[:, 0] == pytest.approx(700.5, abs=1.0)
    assert (line[:, 1].min(), line[:, 1].max()) == pytest.approx((180.0, 229.0), abs=1.5)
    bgr[180:, :800] = BLUE
    edges = far.detect(bgr).road_edges()
    assert set(edges.line.tolist()) == {ROAD_RIGHT}
    assert edges.points[:, 0] == pytest.approx(800.0, abs=1.5)
    assert edges.points[:, 1].max() == pytest.approx(272.0, abs=1.5)
    assert (edges.window, whole.detect(bgr).window) == (far.window, None), "a view can show where it looked"


def test_nothing_beyond_the_window_is_seen_and_a_smaller_image_has_no_window(tmp_path: Path) -> None:
    wide = camera_of(721.5, 1242, 375, (610.0, 173.0))
    far = open_lane_network(str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640)))).far_of(wide)
    assert far is not None
    bgr = np.zeros((375, 1242, 3), np.uint8)
    bgr[:, 100:102] = bgr[300:, 600:602] = RED
    assert len(far.detect(bgr).points) == 0
    bgr[:, 600:602] = RED
    assert len(far.detect(bgr).points) > 0
    narrow = far.detect(bgr[:, :900])
    assert (len(narrow.points), narrow.window) == (0, far.window)


def test_the_far_views_of_two_cameras_share_a_session(tmp_path: Path) -> None:
    whole = open_lane_network(str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640))))
    first = whole.far_of(camera_of(721.5, 1242, 375, (610.0, 173.0)))
    assert first is not None
    second = first.far_of(camera_of(721.5, 1242, 375, (580.0, 173.0)))
    assert second is not None
    assert second._session is first._session
    assert second.name != first.name, "their points differ"
    assert second == whole.far_of(camera_of(721.5, 1242, 375, (580.0, 173.0)))
    assert whole.far_of(None) is None
    assert whole.far_of(camera_of(1818, 2048, 618, (1040, 320))) is None
    curves = open_lane_network(str(lane_networks.lstr(tmp_path / "lstr.onnx")))
    assert curves.far_of(camera_of(721.5, 1242, 375, (610.0, 173.0))) is None, "it needs its own aspect"


def test_a_network_whose_rows_cannot_be_reduced_sees_the_whole_image(tmp_path: Path) -> None:
    network = open_lane_network(str(lane_networks.twin(tmp_path / "twin.onnx", (360, 640), windows=True)))
    assert network.input_size == (360, 640)
    raw = network.detect(image(red=(600, 640)))
    assert raw.points[:, 1].min() == pytest.approx(0.0, abs=4.0)
    assert raw.points[:, 1].max() == pytest.approx(HEIGHT, abs=6.0)


@pytest.mark.parametrize("kind", MASKS)
def test_a_line_is_found_where_it_is_in_the_image(tmp_path: Path, kind: str) -> None:
    make, size, head = MASKS[kind]
    network = open_lane_network(str(make(tmp_path / "tiny.onnx", size)))
    assert network.head.name == head
    raw = network.detect(image(red=(600, 640)))
    assert np.abs(raw.points[:, 0] - 619.5).max() < 6.0
    assert raw.points[:, 1].max() > 0.97 * HEIGHT
    top = {"two masks": 0.45 * HEIGHT, "classes of the lower part": HEIGHT - WIDTH * 52 / 244}.get(
        kind.removesuffix(" of free size"), 0.03 * HEIGHT
    )
    assert raw.points[:, 1].min() == pytest.approx(top, abs=0.05 * HEIGHT)
    assert raw.scores.min() > 0.5
    assert raw.model == network.name
    assert set(raw.line.tolist()) == ({1} if head == "classes" else {-1})


def test_the_edges_of_the_drivable_area_in_front_of_the_car(tmp_path: Path) -> None:
    """Another area beside it, the car's bonnet and the image's border give no edge."""
    bgr = image(blue=(400, 900))
    bgr[:500, 400:900] = 0
    bgr[500:, 1000:1100] = BLUE
    bgr[680:] = 0
    raw = open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx"))).detect(bgr)
    assert raw.painted().points.shape == (0, 2)
    assert raw.road_edges() is raw
    for side, column in ((ROAD_LEFT, 400), (ROAD_RIGHT, 900)):
        edge = raw.points[raw.line == side]
        assert np.abs(edge[:, 0] - column).max() < 6.0
        assert edge[:, 1].min() == pytest.approx(500, abs=8.0)
        assert edge[:, 1].max() == pytest.approx(680, abs=8.0)
    bgr[:, :900] = BLUE
    whole = open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx"))).detect(bgr)
    assert set(whole.line.tolist()) == {ROAD_RIGHT}


def test_classes_are_lines_and_one_that_is_not_there_is_dropped(tmp_path: Path) -> None:
    bgr = image(red=(300, 340), green=(900, 940))
    both = open_lane_network(str(lane_networks.classes(tmp_path / "both.onnx"))).detect(bgr)
    assert both.points[both.line == 1, 0].mean() == pytest.approx(319.5, abs=6.0)
    assert both.points[both.line == 2, 0].mean() == pytest.approx(919.5, abs=6.0)
    one = open_lane_network(str(lane_networks.classes(tmp_path / "one.onnx", there=(0.0, 1.0, 0.2, 0.0)))).detect(bgr)
    assert set(one.line.tolist()) == {1}


@pytest.mark.parametrize(("anchors", "cells", "first_row"), [(56, 100, 160 / 720), (18, 200, 121 / 288)])
def test_a_row_grid_gives_a_place_in_each_row(tmp_path: Path, anchors: int, cells: int, first_row: float) -> None:
    network = open_lane_network(str(lane_networks.rows(tmp_path / "ufld.onnx", anchors, cells, cells // 4)))
    raw = network.detect(image())
    assert raw.points.shape == (anchors, 2)
    assert raw.points[:, 0] == pytest.approx(np.full(anchors, WIDTH * (cells // 4) / (cells - 1)), abs=1.5)
    assert raw.points[0, 1] == pytest.approx(HEIGHT * first_row, abs=1.5)
    assert np.all(np.diff(raw.points[:, 1]) > 0)
    assert set(raw.line.tolist()) == {1}
    assert raw.scores.min() > 0.9


def test_what_is_too_wide_for_a_line_is_none(tmp_path: Path) -> None:
    network = open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx")))
    assert len(network.detect(image(red=(200, 700))).points) == 0
    assert len(network.detect(image()).points) == 0


def test_equal_files_have_equal_names(tmp_path: Path) -> None:
    path = str(lane_networks.twin(tmp_path / "tiny.onnx"))
    names = {open_lane_network(path).name, open_lane_network(path).name}
    assert len(names) == 1
    other = lane_networks.twin(tmp_path / "tiny.onnx", (36, 64))
    assert open_lane_network(str(other)).name not in names


def test_a_file_that_is_no_lane_network_is_refused_with_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(DetectorError, match="not an ONNX file"):
        open_lane_network(str(tmp_path / "text.onnx"))
    with pytest.raises(DetectorError, match=r"yolox\.onnx: its outputs \(1×84×85\) match no known lane network"):
        open_lane_network(str(networks.yolox(tmp_path / "yolox.onnx")))
    with pytest.raises(DetectorError, match=r"\(H, W, 3\) uint8"):
        open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx"))).detect(np.zeros((4, 4), np.uint8))


def test_heads_are_told_apart_by_shape_and_name() -> None:
    mask, boxes = np.zeros((1, 2, 36, 64), np.float32), np.zeros((1, 20, 6), np.float32)
    assert pick_head([mask, mask], ["ll", "da"]).output == 0
    assert pick_head([mask, mask], ["a", "b"]).output == 1
    assert pick_head([boxes, mask, mask], ["det_out", "drive_area_seg", "lane_line_seg"]).name == "YOLOP"
    with pytest.raises(UnknownLaneHead, match="1×20×6"):
        pick_head([boxes], ["x"])


def _points_in_a_table(values: np.ndarray) -> Points:
    return Points(values[:, :2].astype(np.float64), values[:, 2], np.zeros(len(values), np.int32))


def _recognise(answer: LaneOutputs) -> LaneHead | None:
    one_table = len(answer.shapes) == 1 and len(answer.shapes[0]) == 3 and answer.shapes[0][2] == 3
    return LaneHead("table", 0, _points_in_a_table) if one_table else None


def test_a_head_is_added_by_a_file_and_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """The two functions above are all that a new form of output needs."""
    table = np.array([[[0.25, 0.5, 0.9]]], np.float32)
    with pytest.raises(UnknownLaneHead):
        pick_head([table], ["points"])
    monkeypatch.setattr(heads, "HEADS", (*heads.HEADS, _recognise))
    found = pick_head([table], ["points"])
    assert found.name == "table"
    assert found.points([table]).uv.tolist() == [[0.25, 0.5]]


def test_which_lane_detector_is_taken(tmp_path: Path) -> None:
    assert open_lanes(OFF, None) is None
    drawn = open_lanes(None, None, drawn=True)
    assert isinstance(drawn, ClassicalLanes)
    real = open_lanes(None, None)
    assert isinstance(real, ClassicalLanes)
    assert "cipv models pull twinlitenet" in real.notes[0]
    assert "cipv models pull" not in drawn.notes[0]
    with pytest.raises(DetectorMissing, match="No lane network 'nowhere'"):
        open_lanes("nowhere", None)
    model_registry.register(lane_networks.twin(tmp_path / "mine.onnx"), "mine", "lanes")
    installed = open_lanes(None, None)
    assert isinstance(installed, LaneNetwork)
    assert "mine" in installed.notes[0]
    assert isinstance(open_lanes(None, None, drawn=True), ClassicalLanes)
    assert isinstance(open_lanes("classical", None), ClassicalLanes)
    assert isinstance(open_lanes("mine", None, drawn=True), LaneNetwork)
