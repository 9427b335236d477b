"""The one message per frame, taken apart as the page does it."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from app.encode import MAX_WIDTH_PX, UNSEEN, Encoder, encode_picture, ground_plane
from app.line import DetectionCache, Line
from app.snapshot import Snapshot
from pipeline.alignment import resolve
from pipeline.params import Params, with_changes
from pipeline.results import to_json
from pipeline.run import Detectors
from pipeline.types import DROPPED, GROUND, UNCLUSTERED, Picture
from tests.app.recording import GROUND_M, CountingDetector, Recording


def snapshot(params: Params | None = None, index: int = 3, **frame_changes: Any) -> Snapshot:
    """What the engine shows at a frame; ``frame_changes`` replace parts of it."""
    params = params or Params()
    recording = Recording()
    original = recording.frame
    recording.frame = lambda i: replace(original(i), **frame_changes)  # type: ignore[method-assign]
    line = Line(recording, Detectors(CountingDetector()), DetectionCache(), "both")
    return Snapshot(
        params, uri=recording.uri, count=len(recording), index=index, sequence=1, tick=line.seek(index, params)
    )


def taken_apart(message: bytes) -> tuple[dict[str, Any], bytes, dict[str, np.ndarray]]:
    (length,) = struct.unpack_from("<I", message)
    header = json.loads(message[4 : 4 + length])
    start = 4 + length
    size = header["picture"]["bytes"] if header["picture"] else 0
    n, at = header["points"], start + -(-size // 4) * 4
    arrays = {}
    for name, kind, width in (("xyz", "<i2", 3), ("uv", "<i2", 2), ("owner", "<u2", 1), ("kind", "u1", 1)):
        arrays[name] = np.frombuffer(message, kind, n * width, at).reshape(n, width).squeeze()
        at += arrays[name].nbytes
    assert at == len(message), "nothing is left over"
    assert start % 4 == 0, "16-bit arrays can be read in place"
    return header, message[start : start + size], arrays


def test_the_header_holds_the_contracts_result_and_the_state():
    shown = snapshot()
    header, _, _ = taken_apart(Encoder().message(shown) or b"")
    assert shown.tick is not None
    assert header["result"] == json.loads(json.dumps(to_json(shown.tick.result)))
    assert header["state"]["index"] == 3
    assert header["state"]["frame"] == "000003"


def test_points_are_the_sweep_in_centimetres_and_where_the_alignment_puts_them():
    shown = snapshot()
    assert shown.tick is not None
    _, _, arrays = taken_apart(Encoder().message(shown) or b"")
    points = shown.tick.result.layers.points
    np.testing.assert_allclose(arrays["xyz"] / 100.0, points[:, :3], atol=0.0051)
    aligned = resolve(shown.params.alignment, shown.tick.frame.camera)
    assert aligned is not None
    expected = aligned.project(points[:, :3].astype(np.float64))
    seen = ~np.isnan(expected[:, 0])
    np.testing.assert_allclose(arrays["uv"][seen], np.clip(expected[seen], -32767, 32767), atol=0.51)
    assert np.all(arrays["uv"][~seen] == UNSEEN)


def test_each_point_says_what_it_is_and_whose():
    shown = snapshot()
    assert shown.tick is not None
    result = shown.tick.result
    _, _, arrays = taken_apart(Encoder().message(shown) or b"")
    for value, code in ((GROUND, 0), (UNCLUSTERED, 1), (DROPPED, 3)):
        np.testing.assert_array_equal(arrays["kind"] == code, result.layers.kind == value)
    np.testing.assert_array_equal(arrays["kind"] == 2, result.layers.kind >= 0)
    car = next(i for i, item in enumerate(result.objects) if item.source == "VL")
    mine = arrays["owner"] == car + 1
    assert mine.sum() == result.objects[car].lidar_points
    np.testing.assert_allclose(arrays["xyz"][mine, 0] / 100.0, 30.0 - 0.4 * 3, atol=0.01)


def test_moving_the_alignment_moves_the_points_in_the_picture():
    straight = taken_apart(Encoder().message(snapshot()) or b"")[2]["uv"]
    turned = with_changes(Params(), {"alignment.yaw_deg": 2.0})
    moved = taken_apart(Encoder().message(snapshot(turned)) or b"")[2]["uv"]
    both = (straight[:, 0] != UNSEEN) & (moved[:, 0] != UNSEEN)
    assert np.median(np.abs(straight[both, 0] - moved[both, 0])) > 5


def test_the_cameras_own_jpeg_goes_through_untouched():
    shown = snapshot()
    assert shown.tick is not None
    _, jpeg, _ = taken_apart(Encoder().message(shown) or b"")
    assert shown.tick.frame.picture is not None
    assert jpeg == shown.tick.frame.picture.encoded


@pytest.mark.parametrize(
    ("width", "own_jpeg", "sent"), [(640, False, 640), (2048, False, MAX_WIDTH_PX), (2048, True, MAX_WIDTH_PX)]
)
def test_a_picture_is_encoded_when_it_must_be_and_never_too_wide(width: int, own_jpeg: bool, sent: int):
    bgr = np.full((300, width, 3), 77, np.uint8)
    picture = Picture(0, bgr, cv2.imencode(".jpg", bgr)[1].tobytes() if own_jpeg else None)
    made = encode_picture(picture)
    decoded = cv2.imdecode(np.frombuffer(made.jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert decoded.shape[1::-1] == (made.width, made.height)
    assert made.width == sent
    assert made.scale == pytest.approx(sent / width)


def test_boxes_are_in_pixels_of_the_sent_picture():
    wide = Picture(0, np.zeros((360, 2560, 3), np.uint8))
    wide.bgr[100:200, 600:900] = (20, 20, 220)
    header, _, _ = taken_apart(Encoder().message(snapshot(picture=wide, index=0)) or b"")
    assert header["picture"]["scale"] == 0.5
    [box] = header["display"]["vision_boxes"].values()
    assert box == pytest.approx([300, 50, 450, 100], abs=1.0)


@pytest.mark.parametrize("missing", ["picture", "sweep", "camera", "ego"])
def test_a_frame_that_lacks_something_still_makes_a_message(missing: str):
    header, jpeg, arrays = taken_apart(Encoder().message(snapshot(**{missing: None})) or b"")
    assert (header["picture"] is None) == (missing == "picture") == (jpeg == b"")
    assert (len(arrays["kind"]) == 0) == (missing == "sweep")
    assert (header["display"]["path"] is None) == (missing in ("sweep", "camera"))


def test_the_corridor_lies_on_the_ground_that_the_sweep_shows():
    shown = snapshot()
    assert shown.tick is not None
    layers = shown.tick.result.layers
    plane = ground_plane(layers.points, layers.kind)
    assert plane is not None
    np.testing.assert_allclose(plane, [0.0, 0.0, GROUND_M], atol=0.02)
    assert ground_plane(layers.points, np.full_like(layers.kind, UNCLUSTERED)) is None


def test_the_picture_is_encoded_once_while_a_parameter_changes(monkeypatch: pytest.MonkeyPatch):
    made: list[Picture] = []
    monkeypatch.setattr("app.encode.encode_picture", lambda picture: made.append(picture) or encode_picture(picture))
    encoder, shown = Encoder(), snapshot()
    for _ in range(3):
        assert encoder.message(shown)
    assert len(made) == 1


def test_no_message_before_there_is_a_frame():
    assert Encoder().message(Snapshot(Params())) is None
