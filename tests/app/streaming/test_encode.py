"""The one message per frame, taken apart as the page does it."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from app.core.detection_cache import DetectionCache
from app.drive.frame_rows import column_names
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from app.streaming.points import UNKNOWN_AGE, UNSEEN
from app.streaming.sent_image import MAX_WIDTH_PX, encode_image, width_for
from pipeline.alignment.projection import resolve
from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.types import DROPPED, GROUND, U8, UNCLUSTERED, CameraImage
from pipeline.types.lane import EgoLane, LaneLine, Side
from pipeline.types.result_json import to_json
from tests.app.engine.recording_helpers import GROUND_M, CountingDetector, Recording

_ARRAYS = (
    ("xyz", "<i2", 3),
    ("uv", "<i2", 2),
    ("owner", "<u2", 1),
    ("kind", "u1", 1),
    ("intensity", "u1", 1),
    ("ring", "u1", 1),
    ("age", "u1", 1),
)


def snapshot(params: Params | None = None, index: int = 3, **frame_changes: Any) -> Snapshot:
    """The engine's snapshot at a frame; ``frame_changes`` replaces parts of the frame."""
    params = params or Params()
    recording = Recording()
    original = recording.frame
    recording.frame = lambda i: replace(original(i), **frame_changes)  # type: ignore[method-assign]
    pipeline = SeekablePipeline(recording, Detectors(CountingDetector()), DetectionCache(), "both")
    return Snapshot(
        params, uri=recording.uri, count=len(recording), index=index, sequence=1, processed=pipeline.seek(index, params)
    )


def taken_apart(message: bytes) -> tuple[dict[str, Any], bytes, dict[str, np.ndarray]]:
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    start = 4 + length
    size = header["picture"]["bytes"] if header["picture"] else 0
    n, at = header["points"], start + -(-size // 4) * 4
    arrays = {}
    for name, kind, width in _ARRAYS:
        arrays[name] = np.frombuffer(message, kind, n * width, at).reshape(n, width).squeeze()
        at += arrays[name].nbytes
    assert at == len(message), "nothing is left over"
    assert start % 4 == 0, "16-bit arrays can be read in place"
    return header, message[start : start + size], arrays


def test_the_header_holds_the_contracts_result_and_the_state():
    shown = snapshot()
    header, _, _ = taken_apart(Encoder().message(shown) or b"")
    assert shown.processed is not None
    assert header["result"] == json.loads(json.dumps(to_json(shown.processed.result)))
    assert header["state"]["index"] == 3
    assert header["state"]["frame"] == "000003"


def test_a_frame_of_live_sensors_brings_its_row_of_the_timeline():
    assert taken_apart(Encoder().message(snapshot()) or b"")[0]["row"] is None
    live = replace(snapshot(), live=True)
    row = taken_apart(Encoder().message(live) or b"")[0]["row"]
    assert live.processed is not None
    lead = live.processed.result.cipv
    assert lead is not None
    assert set(row) == set(column_names())
    assert row["cipv_id"] == lead.id
    assert row["distance_m"] == round(lead.distance_m, 4)


def test_points_are_the_sweep_in_centimetres_and_where_the_alignment_puts_them():
    shown = snapshot()
    assert shown.processed is not None
    _, _, arrays = taken_apart(Encoder().message(shown) or b"")
    points = shown.processed.result.layers.points
    np.testing.assert_allclose(arrays["xyz"] / 100.0, points[:, :3], atol=0.0051)
    aligned = resolve(shown.params.alignment, shown.processed.frame.camera)
    assert aligned is not None
    expected = aligned.project(points[:, :3].astype(np.float64))
    seen = ~np.isnan(expected[:, 0])
    np.testing.assert_allclose(arrays["uv"][seen], np.clip(expected[seen], -32767, 32767), atol=0.51)
    assert np.all(arrays["uv"][~seen] == UNSEEN)


def test_each_point_says_what_it_is_and_whose():
    shown = snapshot()
    assert shown.processed is not None
    result = shown.processed.result
    _, _, arrays = taken_apart(Encoder().message(shown) or b"")
    for value, code in ((GROUND, 0), (UNCLUSTERED, 1), (DROPPED, 3)):
        np.testing.assert_array_equal(arrays["kind"] == code, result.layers.kind == value)
    np.testing.assert_array_equal(arrays["kind"] == 2, result.layers.kind >= 0)
    car = next(i for i, item in enumerate(result.objects) if item.source == "VL")
    mine = arrays["owner"] == car + 1
    assert mine.sum() == result.objects[car].lidar_points
    np.testing.assert_allclose(arrays["xyz"][mine, 0] / 100.0, 30.0 - 0.4 * 3, atol=0.01)


def test_moving_the_alignment_moves_the_points_in_the_image():
    straight = taken_apart(Encoder().message(snapshot()) or b"")[2]["uv"]
    turned = with_changes(Params(), {"alignment.yaw_deg": 2.0})
    moved = taken_apart(Encoder().message(snapshot(turned)) or b"")[2]["uv"]
    both = (straight[:, 0] != UNSEEN) & (moved[:, 0] != UNSEEN)
    assert np.median(np.abs(straight[both, 0] - moved[both, 0])) > 5


def test_the_cameras_own_jpeg_goes_through_untouched():
    shown = snapshot()
    assert shown.processed is not None
    _, jpeg, _ = taken_apart(Encoder().message(shown) or b"")
    assert shown.processed.frame.image is not None
    assert jpeg == shown.processed.frame.image.encoded


@pytest.mark.parametrize(
    ("width", "own_jpeg", "sent"), [(640, False, 640), (2048, False, MAX_WIDTH_PX), (2048, True, MAX_WIDTH_PX)]
)
def test_an_image_is_encoded_when_it_must_be_and_never_too_wide(width: int, own_jpeg: bool, sent: int):
    bgr = np.full((300, width, 3), 77, np.uint8)
    image = CameraImage(0, bgr, cv2.imencode(".jpg", bgr)[1].tobytes() if own_jpeg else None)
    made = encode_image(image)
    decoded = cv2.imdecode(np.frombuffer(made.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape[1::-1] == (made.width, made.height)
    assert made.width == sent
    assert made.scale == pytest.approx(sent / width)


def _wide() -> U8:
    """An image twice as wide as the one that is sent, with one red car."""
    bgr: U8 = np.zeros((360, 2560, 3), np.uint8)
    bgr[100:200, 600:900] = (20, 20, 220)
    return bgr


def test_boxes_are_in_pixels_of_the_sent_image():
    header, _, _ = taken_apart(Encoder().message(snapshot(image=CameraImage(0, _wide()), index=0)) or b"")
    assert header["picture"]["scale"] == 0.5
    [box] = header["display"]["vision_boxes"].values()
    assert box == pytest.approx([300, 50, 450, 100], abs=1.0)


def test_the_size_of_the_camera_is_not_that_of_the_sent_image_scaled_back():
    """618 rows sent at 1280 of 2048 columns are 386, which would be 617.6."""
    bgr: U8 = np.zeros((618, 2048, 3), np.uint8)
    bgr[300:400, 600:900] = (20, 20, 220)
    header, _, _ = taken_apart(Encoder().message(snapshot(image=CameraImage(0, bgr), index=0)) or b"")
    assert (header["picture"]["full_width"], header["picture"]["full_height"]) == (2048, 618)


@pytest.mark.parametrize("missing", ["image", "sweep", "camera", "ego"])
def test_a_frame_that_lacks_something_still_makes_a_message(missing: str):
    header, jpeg, arrays = taken_apart(Encoder().message(snapshot(**{missing: None})) or b"")
    assert (header["picture"] is None) == (missing == "image") == (jpeg == b"")
    assert (len(arrays["kind"]) == 0) == (missing == "sweep")
    assert (header["display"]["path"] is None) == (missing in ("sweep", "camera"))


def test_the_corridor_lies_on_the_ground_that_was_fitted():
    shown = snapshot()
    assert shown.processed is not None
    result = shown.processed.result
    aligned = resolve(shown.params.alignment, shown.processed.frame.camera)
    assert aligned is not None
    header, _, _ = taken_apart(Encoder().message(shown) or b"")
    flat = np.column_stack([result.path.left, np.full(len(result.path.left), GROUND_M)])
    pixels = aligned.project(flat)
    for sent, (u, v) in zip(header["display"]["path"]["left"], pixels, strict=True):
        assert sent == (None if np.isnan(u) else pytest.approx([u, v], abs=3.0))
    nx, ny, nz, d = header["display"]["ground"]["planes"][0]
    assert -(d + 20.0 * nx + 0.0 * ny) / nz == pytest.approx(GROUND_M, abs=0.05)


def lane_line(side: Side, offset_m: float) -> LaneLine:
    return LaneLine(side, np.array([offset_m, 0.0, 1e-3, 0.0]), np.eye(4), 4.0, 30.0, 1.0, 0.0)


def test_lane_lines_are_drawn_in_the_image_and_in_the_plan():
    shown = snapshot()
    assert shown.processed is not None
    lane = EgoLane(lane_line("left", 1.8), None, "classical", 0.0, 0.0, None, np.array([0.0, 0.0, GROUND_M]))
    layers = replace(shown.processed.result.layers, lanes=lane)
    tick = replace(shown.processed, result=replace(shown.processed.result, layers=layers))
    display = taken_apart(Encoder().message(replace(shown, processed=tick)) or b"")[0]["display"]
    left = display["plan_lanes"]["left"]
    assert left[0] == pytest.approx([4.0, 1.8 + 0.016])
    assert left[-1] == pytest.approx([30.0, 1.8 + 0.9])
    assert display["plan_lanes"]["right"] == display["lanes"]["right"] == []
    aligned = resolve(shown.params.alignment, shown.processed.frame.camera)
    assert aligned is not None
    expected = aligned.project(np.array([[30.0, 2.7, GROUND_M]]))[0]
    assert display["lanes"]["left"][-1] == pytest.approx(expected.tolist(), abs=3.0)
    assert taken_apart(Encoder().message(shown) or b"")[0]["display"]["lanes"] is None


def test_points_keep_their_intensity_ring_and_age():
    original = snapshot()
    assert original.processed is not None
    sweep = original.processed.frame.sweep
    assert sweep is not None
    _, _, untimed = taken_apart(Encoder().message(original) or b"")
    np.testing.assert_array_equal(untimed["ring"], sweep.ring)
    assert np.all(untimed["age"] == UNKNOWN_AGE)
    time_s = np.linspace(-0.1, 0.0, len(sweep.points), dtype=np.float32)
    points = sweep.points.copy()
    points[:, 3] = np.arange(len(points)) % 200 + 1.0
    _, _, arrays = taken_apart(Encoder().message(snapshot(sweep=replace(sweep, points=points, time_s=time_s))) or b"")
    np.testing.assert_array_equal(arrays["intensity"], points[:, 3])
    assert arrays["age"][0] == pytest.approx(100, abs=1)
    assert arrays["age"][-1] == 0


def test_reflectance_between_0_and_1_uses_all_shades():
    sweep = snapshot().processed.frame.sweep  # type: ignore[union-attr]
    assert sweep is not None
    points = sweep.points.copy()
    points[:, 3] = np.linspace(0.0, 1.0, len(points))
    _, _, arrays = taken_apart(Encoder().message(snapshot(sweep=replace(sweep, points=points))) or b"")
    assert (arrays["intensity"].min(), arrays["intensity"].max()) == (0, 255)


@pytest.mark.parametrize(("shown_px", "sent"), [(0, 320), (100.5, 320), (640, 640), (833, 960), (1600, 1600)])
def test_images_are_sent_as_wide_as_they_are_shown_in_steps(shown_px: float, sent: int):
    assert width_for(shown_px) == sent


def test_a_wider_image_is_encoded_when_somebody_shows_it_wider():
    shown = snapshot(image=CameraImage(0, _wide()), index=0)
    encoder = Encoder()
    widths = [taken_apart(encoder.message(shown, width) or b"")[0]["picture"]["width"] for width in (640, 960, 640)]
    assert widths == [640, 960, 640]


def test_the_image_is_encoded_once_while_a_parameter_changes(monkeypatch: pytest.MonkeyPatch):
    made: list[CameraImage] = []
    monkeypatch.setattr(
        "app.streaming.encode.encode_image",
        lambda image, width: made.append(image) or encode_image(image, width),
    )
    encoder, shown = Encoder(), snapshot()
    for _ in range(3):
        assert encoder.message(shown)
    assert len(made) == 1


def test_no_message_before_there_is_a_frame():
    assert Encoder().message(Snapshot(Params())) is None
