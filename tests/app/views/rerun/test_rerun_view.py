"""A replay read back: what was written, when, and under which name."""

from __future__ import annotations

import dataclasses
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from app.views import scene
from app.views.colors import rgb
from app.views.rerun.view import APPLICATION, ReplayError, RerunSink
from pipeline.params import AlignmentParams
from pipeline.types import Frame, Layers, Result

Ticks = list[tuple[Frame, Result]]


def write(path: Path, ticks: Ticks) -> Path:
    with RerunSink(path, "a drive", AlignmentParams()) as sink:
        for frame, result in ticks:
            sink.show(frame, result)
    return path


def rows(path: Path, entity: str, component: str) -> list[tuple[int, Any]]:
    """(frame, value) of every row of a component, in order of time; without nulls left by clearing."""
    found: list[tuple[int, Any]] = []
    for chunk in RrdReader(path).stream().to_chunks():
        table = chunk.to_record_batch().to_pydict()
        if chunk.entity_path == entity and component in table and not chunk.is_static:
            found += [(at, value) for at, value in zip(table["frame"], table[component], strict=True) if value]
    return sorted(found, key=lambda row: row[0])


def entities(path: Path) -> set[str]:
    return {chunk.entity_path for chunk in RrdReader(path).stream().to_chunks()}


def packed(color: tuple[int, int, int]) -> int:
    """0xRRGGBBAA, as in the file."""
    return int.from_bytes(bytes((*color, 255)), "big")


def test_the_parts_of_a_frame_are_there(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames)
    expected = (
        "/world/points /world/cuboids /world/footprints /world/path/center /world/path/left /world/path/right "
        "/world/ego /world/camera /world/camera/image /world/camera/overlay/points /world/camera/overlay/lidar_boxes "
        "/world/camera/overlay/vision_boxes /world/camera/overlay/cipv /bev/footprints /bev/velocity /bev/path/center "
        "/curves/distance/cipv /curves/closing_speed/cipv /curves/ttc/cipv /curves/speed/desired /curves/timing/total "
        "/reasons/cipv /reasons/rejected"
    )
    assert entities(path) >= set(expected.split())


def test_values_and_timelines_are_the_results_own(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames)
    assert rows(path, "/curves/distance/cipv", "Scalars:scalars") == [(0, [19.9]), (1, [19.9]), (2, [19.9])]
    assert rows(path, "/curves/ttc/cipv", "Scalars:scalars")[0] == (0, [7.96])
    assert rows(path, "/curves/speed/desired", "Scalars:scalars")[0][1][0] == pytest.approx(13.0 * 3.6)
    chunks = [c for c in RrdReader(path).stream().to_chunks() if c.entity_path == "/world/points"]
    assert {name for chunk in chunks for name in chunk.timeline_names} == {"frame", "sensor_time"}
    times = [t for c in chunks for t in c.to_record_batch().column("sensor_time").cast("int64").to_pylist()]
    assert sorted(times) == [frame.t_ns for frame, _ in frames]


def test_points_keep_their_places_and_colours(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames[:1])
    result = frames[0][1]
    places = np.array(rows(path, "/world/points", "Points3D:positions")[0][1])
    colors = rows(path, "/world/points", "Points3D:colors")[0][1]
    assert np.array_equal(places, result.layers.points[:, :3])
    assert colors == [packed(tuple(color)) for color in scene.point_colors(result).tolist()]


def test_cuboids_are_magenta_the_cipv_green_and_named(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames[:1])
    for entity, text, role in (
        ("/world/cuboids", "#8 obstacle 15.9 m", "lidar"),
        ("/world/cipv", "#7 car 19.9 m", "cipv"),
    ):
        assert rows(path, entity, "Boxes3D:labels")[0][1] == [text]
        assert rows(path, entity, "Boxes3D:colors")[0][1] == [packed(rgb(role))]
    assert rows(path, "/world/cipv", "Boxes3D:centers")[0][1][0] == pytest.approx([22.0, 0.2, -0.5])
    assert rows(path, "/world/labels", "Points3D:labels")[0][1] == ["#7 car 19.9 m"]


def test_boxes_in_the_image_are_where_the_result_has_them(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames[:1])
    overlay = "/world/camera/overlay"
    assert rows(path, f"{overlay}/vision_boxes", "Boxes2D:centers")[0][1] == [[161.0, 71.5], [305.0, 55.0]]
    assert rows(path, f"{overlay}/lidar_boxes", "Boxes2D:centers")[0][1] == [[161.0, 71.5]]
    assert rows(path, f"{overlay}/cipv", "Boxes2D:half_sizes")[0][1] == [[21.0, 16.5]]


def test_projected_points_lie_in_the_image(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames[:1])
    pixels = np.array(rows(path, "/world/camera/overlay/points", "Points2D:positions")[0][1])
    assert 0 < len(pixels) < len(frames[0][1].layers.points)
    assert pixels.min() >= 0
    assert (pixels < [320, 120]).all()


def test_the_cameras_own_jpeg_goes_in_untouched_and_a_raw_image_is_encoded(tmp_path: Path, frames: Ticks) -> None:
    (first, result), (second, _) = frames[:2]
    assert first.image is not None
    assert second.image is not None
    raw = dataclasses.replace(second, image=dataclasses.replace(second.image, encoded=None))
    path = write(tmp_path / "a.rrd", [(first, result), (raw, result)])
    (_, kept), (_, encoded) = rows(path, "/world/camera/image", "EncodedImage:blob")
    assert bytes(kept[0]) == first.image.encoded
    assert bytes(encoded[0])[:2] == b"\xff\xd8"


def test_what_ends_is_cleared_and_a_null_breaks_the_curve(tmp_path: Path, frames: Ticks) -> None:
    (first, full), (second, _) = frames[:2]
    nothing = Layers(np.zeros((0, 4), np.float32), np.zeros(0, np.int32))
    empty = dataclasses.replace(full, objects=(), cipv=None, acc=None, rejected=(), layers=nothing)
    blind = dataclasses.replace(second, image=None, camera=None)
    path = write(tmp_path / "a.rrd", [(first, full), (blind, empty)])
    for entity, component in {
        "/curves/distance/cipv": "Scalars:scalars",
        "/world/points": "Points3D:positions",
        "/world/cuboids": "Boxes3D:centers",
        "/world/camera/image": "EncodedImage:blob",
        "/bev/footprints": "LineStrips2D:strips",
    }.items():
        assert [at for at, _ in rows(path, entity, component)] == [0], entity
        assert rows(path, entity, "Clear:is_recursive") == [(1, [False])], entity
    assert rows(path, "/reasons/cipv", "TextLog:text")[1] == (1, ["no vehicle in path"])


def test_a_replay_carries_its_layout_and_its_name(tmp_path: Path, frames: Ticks) -> None:
    reader = RrdReader(write(tmp_path / "a.rrd", frames))
    assert [store.application_id for store in reader.blueprints()] == [APPLICATION]
    names = [c.to_record_batch().to_pydict() for c in reader.stream().to_chunks() if c.entity_path == "/__properties"]
    assert [each["RecordingInfo:name"] for each in names] == [[["a drive"]]]


def test_bird_eye_view_has_forward_up_and_left_left(tmp_path: Path, frames: Ticks) -> None:
    path = write(tmp_path / "a.rrd", frames[:1])
    strips = rows(path, "/bev/footprints", "LineStrips2D:strips")[0][1]
    truck = np.array(strips[2])  # 45–47 m ahead, 6.6–9 m to the left
    assert truck[:, 0].max() == pytest.approx(-6.6)
    assert truck[:, 1].max() == pytest.approx(-45.0)


def test_nothing_goes_to_the_global_recording(tmp_path: Path, frames: Ticks) -> None:
    write(tmp_path / "a.rrd", frames[:1])
    assert rr.get_global_data_recording() is None


def test_a_stream_gets_the_same_replay_and_stays_open(tmp_path: Path, frames: Ticks) -> None:
    stream = io.BytesIO()
    with RerunSink(stream) as sink:
        for frame, result in frames:
            sink.show(frame, result)
    (tmp_path / "b.rrd").write_bytes(stream.getvalue())
    assert rows(tmp_path / "b.rrd", "/curves/distance/cipv", "Scalars:scalars")[2] == (2, [19.9])


def test_closing_twice_is_allowed(tmp_path: Path) -> None:
    sink = RerunSink(tmp_path / "a.rrd")
    sink.close()
    sink.close()


@pytest.mark.parametrize("where", ["missing/folder/a.rrd", "."])
def test_a_file_that_cannot_be_made_is_one_sentence(tmp_path: Path, where: str) -> None:
    with pytest.raises(ReplayError, match=r"cannot write the rerun file: \w+") as caught:
        RerunSink(tmp_path / where)
    assert str(tmp_path / where) in str(caught.value)
    assert "\n" not in str(caught.value)
