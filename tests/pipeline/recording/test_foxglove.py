"""A session is what Foxglove expects: MCAP's own readers find every checksum right, and its messages are of the schemas
that Foxglove publishes."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import cv2
import foxglove.messages
import numpy as np
import pytest
from jsonschema import Draft202012Validator
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Channel, Message, Schema

from pipeline.params import Params
from pipeline.recording.recorder import Recorder
from pipeline.recording.rewrite import recover
from pipeline.recording.topics import protobuf_class
from pipeline.step import State, step
from pipeline.types.camera_shot import Shot
from pipeline.types.result_json import to_json
from tests.pipeline.recording.frames import ABOUT, full, image

FRAMES = 12
Row = tuple[Schema | None, Channel, Message]

NUMERIC_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 8: 8}
"""``foxglove.NumericType``: UINT8, INT8, UINT16, INT16, UINT32, INT32, FLOAT32, FLOAT64."""
WELL_KNOWN = {
    "/lidar/points": "PointCloud",
    "/camera/image": "CompressedImage",
    "/camera/calibration": "CameraCalibration",
    "/gnss": "LocationFix",
    "/tf": "FrameTransform",
    "/objects": "SceneUpdate",
    "/marks": "Log",
    "/notes": "Log",
}


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with everything that a live recording contains: frames with results, images and samples between them,
    packets, a mark."""
    path, state = tmp_path_factory.mktemp("foxglove") / "a.mcap", State()
    recorder = Recorder(path, ABOUT)
    for index in range(FRAMES):
        frame = full(index)
        state, result = step(state, frame, Params())
        assert frame.ego is not None
        assert frame.gnss is not None
        recorder.image(Shot(encoded=image(50 + index).encoded), frame.t_ns - 40_000_000, frame.t_ns - 3)
        recorder.ego(frame.ego, frame.t_ns - 2)
        recorder.fix(frame.gnss, frame.t_ns - 1)
        recorder.put_packets([(frame.t_ns, bytes(1206))])
        recorder.put(frame, result, Params(), received_ns=frame.t_ns)
        assert to_json(result)["frame"] == frame.name
    recorder.mark("here")
    assert recorder.stop().error is None
    return path


def read(path: Path) -> list[Row]:
    with path.open("rb") as file:
        return list(SeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))


@pytest.fixture(scope="module")
def rows(session: Path) -> list[Row]:
    return read(session)


def test_every_checksum_is_right_and_the_summary_says_what_is_there(session: Path, rows: list[Row]) -> None:
    with session.open("rb") as file:
        streamed = list(NonSeekingReader(file, validate_crcs=True).iter_messages(log_time_order=False))
    assert [message for _, _, message in streamed] == [message for _, _, message in rows]
    with session.open("rb") as file:
        summary = SeekingReader(file, validate_crcs=True).get_summary()
    assert summary is not None
    statistics = summary.statistics
    assert statistics is not None
    counted = Counter(message.channel_id for _, _, message in rows)
    assert statistics.channel_message_counts == dict(counted)
    times = [message.log_time for _, _, message in rows]
    assert (statistics.message_count, statistics.message_start_time, statistics.message_end_time) == (
        len(rows), min(times), max(times),
    )  # fmt: skip
    assert statistics.chunk_count == len(summary.chunk_indexes) > 0
    assert statistics.schema_count == len(summary.schemas)
    assert statistics.channel_count == len(summary.channels)
    for index in summary.chunk_indexes:
        held = [t for t in times if index.message_start_time <= t <= index.message_end_time]
        assert held, "a chunk that is named holds messages"
        assert set(index.message_index_offsets) <= set(summary.channels)


def test_one_message_a_moment_and_topic_so_that_any_can_be_found(rows: list[Row]) -> None:
    found = Counter((channel.topic, message.log_time) for _, channel, message in rows if channel.topic != "/tf")
    notes = {key for key in found if key[0] == "/notes"}
    assert [key for key, count in found.items() if count > 1 and key not in notes] == []


def test_schemas_are_the_published_ones(rows: list[Row]) -> None:
    schemas = {channel.topic: schema for schema, channel, _ in rows}
    assert schemas.keys() >= WELL_KNOWN.keys()
    for topic, name in WELL_KNOWN.items():
        schema, published = schemas[topic], getattr(foxglove.messages, name).get_schema()
        assert schema is not None
        assert (schema.name, schema.encoding, schema.data) == (f"foxglove.{name}", "protobuf", published.data), topic


def parsed(rows: list[Row], topic: str) -> list[tuple[Any, Message]]:
    """Messages of a topic, parsed with the schema in the file."""
    found = []
    for schema, channel, message in rows:
        if channel.topic == topic:
            assert schema is not None
            assert channel.message_encoding == "protobuf"
            kind = protobuf_class(schema.name, schema.data)
            content = kind.FromString(message.data)
            content.DiscardUnknownFields()
            assert content.SerializeToString(deterministic=True) == message.data, "a field that the schema lacks"
            found.append((content, message))
    return found


def test_clouds_lie_as_their_fields_say(rows: list[Row]) -> None:
    for cloud, message in parsed(rows, "/lidar/points"):
        assert cloud.frame_id == "ego"
        assert cloud.timestamp.seconds * 10**9 + cloud.timestamp.nanos == message.publish_time
        assert len(cloud.data) == 40 * cloud.point_stride
        ends = [field.offset + NUMERIC_BYTES[field.type] for field in cloud.fields]
        assert max(ends) == cloud.point_stride
        assert {field.name for field in cloud.fields} >= {"x", "y", "z", "intensity", "ring"}


def test_images_can_be_decoded_by_what_their_format_says(rows: list[Row]) -> None:
    images = parsed(rows, "/camera/image")
    assert len(images) == 2 * FRAMES
    magic = {"jpeg": b"\xff\xd8\xff", "png": b"\x89PNG"}
    for shown, message in images:
        assert shown.frame_id == "camera"
        assert shown.timestamp.seconds * 10**9 + shown.timestamp.nanos == message.publish_time
        assert shown.data.startswith(magic[shown.format])
        assert cv2.imdecode(np.frombuffer(shown.data, np.uint8), cv2.IMREAD_COLOR).shape == (24, 32, 3)


def test_the_camera_and_where_it_sits(rows: list[Row]) -> None:
    (calibration, _), *_ = parsed(rows, "/camera/calibration")
    assert (len(calibration.K), len(calibration.R), len(calibration.P)) == (9, 9, 12)
    assert len(calibration.D) == {"plumb_bob": 5, "rational_polynomial": 8}[calibration.distortion_model]
    transforms = [transform for transform, _ in parsed(rows, "/tf")]
    frames = {transform.child_frame_id: transform.parent_frame_id for transform in transforms}
    assert frames == {"lidar": "ego", "camera": "ego"}
    for transform in transforms:
        turned = transform.rotation
        assert np.hypot(np.hypot(turned.x, turned.y), np.hypot(turned.z, turned.w)) == pytest.approx(1.0)


def test_places_marks_and_boxes(rows: list[Row]) -> None:
    for fix, _ in parsed(rows, "/gnss"):
        assert abs(fix.latitude) <= 90.0
        assert abs(fix.longitude) <= 180.0
        assert len(fix.position_covariance) == 9
    for topic, level in (("/marks", 2), ("/notes", 3)):
        assert {log.level for log, _ in parsed(rows, topic)} == {level}
    assert [log.message for log, _ in parsed(rows, "/marks")] == ["here"]
    for update, _ in parsed(rows, "/objects"):
        ids = [entity.id for entity in update.entities]
        assert len(set(ids)) == len(ids)
        assert {entity.frame_id for entity in update.entities} <= {"ego"}


def test_what_is_json_is_valid_by_the_schema_beside_it(rows: list[Row]) -> None:
    seen = set()
    for schema, channel, message in rows:
        if channel.message_encoding == "json":
            assert schema is not None
            assert schema.encoding == "jsonschema"
            described = json.loads(schema.data)
            Draft202012Validator.check_schema(described)
            Draft202012Validator(described).validate(_without_null(json.loads(message.data)))
            seen.add(channel.topic)
    assert seen >= {"/frames", "/ego", "/params", "/results", "/health", "/route"}


def test_a_recovered_file_is_as_sound(session: Path, rows: list[Row], tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(session.read_bytes()[:-500])
    recover(cut, tmp_path / "out.mcap")
    saved = [message for _, _, message in read(tmp_path / "out.mcap")]
    assert [(m.log_time, m.data) for m in saved] == [(m.log_time, m.data) for _, _, m in rows][: len(saved)]
    assert saved


def _without_null(value: Any) -> Any:
    """Without nulls, which viewers do not plot."""
    if isinstance(value, dict):
        return {key: _without_null(inner) for key, inner in value.items() if inner is not None}
    return value
