"""rerun opens a session as it is: its own loader finds points, images, the camera and their transforms."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from tests.pipeline.recording.frames import CAMERA, full, write

FRAMES = 3


@pytest.fixture(scope="module")
def columns(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[pa.Array]]:
    """``entity component`` → its values, one piece per chunk, as read by rerun's MCAP loader."""
    folder = tmp_path_factory.mktemp("rerun")
    session = write(folder / "a.mcap", [full(index) for index in range(FRAMES)])
    recording = rr.RecordingStream("test_session")
    recording.save(folder / "a.rrd")
    recording.log_file_from_path(session)
    recording.flush()
    recording.disconnect()
    found = defaultdict(list)
    for chunk in RrdReader(folder / "a.rrd").stream().to_chunks():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            found[f"{chunk.entity_path} {name}"].append(batch.column(name))
    return found


def test_points_are_drawn_in_the_ego_frame(columns: dict[str, list[pa.Array]]) -> None:
    clouds = [cloud for piece in columns["/lidar/points Points3D:positions"] for cloud in piece.to_pylist()]
    expected = [full(index).sweep.points[:, :3] for index in range(FRAMES)]  # type: ignore[union-attr]
    assert len(clouds) == FRAMES
    for cloud, points in zip(clouds, expected, strict=True):
        np.testing.assert_array_equal(np.array(cloud, np.float32), points)
    assert _values(columns["/lidar/points CoordinateFrame:frame"]) == {"ego"}


def test_images_are_the_cameras_own_bytes(columns: dict[str, list[pa.Array]]) -> None:
    blobs = [bytes(blob[0]) for piece in columns["/camera/image EncodedImage:blob"] for blob in piece.to_pylist()]
    assert blobs == [full(index).image.encoded for index in range(FRAMES)]  # type: ignore[union-attr]


def test_a_transform_leads_from_the_points_to_the_camera(columns: dict[str, list[pa.Array]]) -> None:
    assert _values(columns["/tf Transform3D:parent_frame"]) == {"ego"}
    assert _values(columns["/tf Transform3D:child_frame"]) == {"lidar", "camera"}
    places = [place for piece in columns["/tf Transform3D:translation"] for row in piece.to_pylist() for place in row]
    camera_in_ego = -CAMERA.T_camera_ego[:3, :3].T @ CAMERA.T_camera_ego[:3, 3]
    assert any(np.allclose(place, camera_in_ego) for place in places)


def test_the_camera_is_known_as_a_pinhole(columns: dict[str, list[pa.Array]]) -> None:
    (matrix,) = columns["/camera/calibration Pinhole:image_from_camera"][0].to_pylist()[0]
    np.testing.assert_allclose(np.reshape(matrix, (3, 3)).T, CAMERA.K)
    assert _values(columns["/camera/calibration Pinhole:parent_frame"]) == {"camera"}
    assert _values(columns["/camera/image CoordinateFrame:frame"]) == _values(
        columns["/camera/calibration Pinhole:child_frame"]
    )


def test_where_the_car_is_on_the_map(columns: dict[str, list[pa.Array]]) -> None:
    places = [place for piece in columns["/gnss GeoPoints:positions"] for row in piece.to_pylist() for place in row]
    fixes = [full(index).gnss for index in range(FRAMES)]
    np.testing.assert_allclose(places, [(fix.lat_deg, fix.lon_deg) for fix in fixes])  # type: ignore[union-attr]


def test_notes_are_text(columns: dict[str, list[pa.Array]]) -> None:
    assert "gnss silent for 1.0 s (antenna?)" in _values(columns["/notes TextLog:text"])


def _values(pieces: list[pa.Array]) -> set[str]:
    return {value for piece in pieces for row in piece.to_pylist() for value in (row or ())}
