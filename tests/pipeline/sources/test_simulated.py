"""The simulator as a source."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.evaluation.lead_verdict import LeadRule, true_lead
from pipeline.params import AlignmentParams
from pipeline.sources import SourceError, open_source
from pipeline.types import Frame
from pipeline.types.source import Source


@pytest.fixture(scope="module")
def frames() -> dict[int, Frame]:
    source = open_source("sim:straight")
    return {index: source.frame(index) for index in (0, 80, 100)}


def test_twenty_seconds_at_ten_hertz() -> None:
    source = open_source("sim:straight")
    assert (len(source), source.rate_hz) == (200, 10.0)
    assert [source.t_ns(i) for i in (0, 1, 199)] == [0, 100_000_000, 19_900_000_000]
    for index in (-1, 200):
        with pytest.raises(IndexError):
            source.frame(index)


def test_a_frame_is_whole(frames: dict[int, Frame]) -> None:
    frame = frames[80]
    assert frame.notes == ()
    assert frame.sweep is not None
    assert frame.sweep.points.dtype == np.float32
    assert frame.sweep.points.flags.c_contiguous
    assert np.all(np.isfinite(frame.sweep.points))
    assert frame.image is not None
    assert frame.image.bgr.shape == (720, 1280, 3)
    assert frame.image.encoded is None
    assert frame.ego is not None
    assert frame.ego.speed_mps == pytest.approx(15.4, abs=0.1)
    assert frame.t_ns == frame.sweep.t_ns == frame.image.t_ns == frame.ego.t_ns


def test_any_order_gives_the_same_bytes(frames: dict[int, Frame]) -> None:
    again = open_source("sim:straight").frame(80)
    first = frames[80]
    assert first.sweep is not None
    assert again.sweep is not None
    assert first.image is not None
    assert again.image is not None
    assert again.sweep.points.tobytes() == first.sweep.points.tobytes()
    assert again.image.bgr.tobytes() == first.image.bgr.tobytes()
    assert first.sweep.points.tobytes() != frames[100].sweep.points.tobytes()  # type: ignore[union-attr]


def test_truth_image_and_sweep_agree_on_the_lead(frames: dict[int, Frame]) -> None:
    """The lead's cuboid contains LiDAR points, and its image box is mostly its red paint and lights."""
    frame = frames[100]
    truth = open_source("sim:straight").truth(100)
    assert truth is not None
    lead = next(item for item in truth if item.id == 1)
    assert lead.label == "car"
    assert frame.sweep is not None
    assert frame.image is not None
    away = np.abs(frame.sweep.points[:, :3] - np.array(lead.cuboid.center))
    assert np.count_nonzero(np.all(away < np.array(lead.cuboid.size) / 2 + 0.1, axis=1)) >= 10
    alignment = resolve(AlignmentParams(), frame.camera)
    assert alignment is not None
    box = project_cuboid(alignment, lead.cuboid.corners(), 1280, 720)
    assert box is not None
    x1, y1, x2, y2 = (round(value) for value in box)
    inside = frame.image.bgr[y1:y2, x1:x2].reshape(-1, 3).astype(int)
    beside = frame.image.bgr[y1:y2, x1 - 30 : x1 - 8].reshape(-1, 3).astype(int)
    assert np.mean(inside[:, 2] > inside[:, 1] + 60) > 0.3
    assert np.mean(beside[:, 2] > beside[:, 1] + 60) < 0.02


def test_a_scenario_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(
        "{title: Mine, duration_s: 1, road: {segments: [{length_m: 500}]}, ego: {lane: -1, speed_mps: {0: 10}}}"
    )
    source = open_source(f"sim:{path}")
    assert (source.title, len(source), source.truth(3)) == ("Mine", 10, ())
    path.write_text("{title: Mine, colour: red}")
    with pytest.raises(SourceError, match=r"mine\.yaml: "):
        open_source(f"sim:{path}")


def test_the_lead_of_a_bend_is_the_vehicle_on_the_road_and_not_the_one_straight_ahead(tmp_path: Path) -> None:
    path = tmp_path / "bend.yaml"
    path.write_text(
        "{title: Bend, duration_s: 3, road: {segments: [{length_m: 500, radius_m: 60}], lanes_forward: 1, "
        "lanes_oncoming: 1, median_m: 0}, ego: {lane: -1, speed_mps: {0: 10}}, actors: ["
        "{id: 1, kind: car, lane: -1, ahead_m: 35, speed_mps: {0: 10}}, "
        "{id: 2, kind: car, lane: -1, ahead_m: 15, speed_mps: {0: 10}, offset_m: -4}]}"
    )
    truth = open_source(f"sim:{path}").truth(20)
    assert truth is not None
    lead, parked = truth
    assert lead.cuboid.center[1] > 8.0
    assert lead.path_offset_m == pytest.approx(0.0, abs=0.05)
    assert abs(parked.path_offset_m or 0.0) > 2.0
    assert true_lead(truth, LeadRule()) is lead


def _with_faults(tmp_path: Path, name: str, faults: str) -> Source:
    path = tmp_path / f"{name}.yaml"
    path.write_text(
        "{title: Faulty, duration_s: 2, road: {segments: [{length_m: 900}]}, ego: {lane: -2, speed_mps: {0: 20}}, "
        "actors: [{id: 1, kind: car, lane: -2, ahead_m: 20, colour: '#ff1010', speed_mps: {0: 10}}], "
        f"camera: {{noise: 0, exposure_stops: 0}}, faults: {{{faults}}}}}"
    )
    return open_source(f"sim:{path}")


def _red_columns(frame: Frame) -> tuple[int, int]:
    """First and last column of the red car."""
    assert frame.image is not None
    blue, green, red = np.moveaxis(frame.image.bgr.astype(int), 2, 0)
    columns = np.flatnonzero((red - np.maximum(blue, green) > 60).any(axis=0))
    return int(columns[0]), int(columns[-1])


def test_a_knocked_camera_shows_it_in_the_image_and_not_in_its_calibration(tmp_path: Path) -> None:
    sound = _with_faults(tmp_path, "sound", "")
    knocked = _with_faults(tmp_path, "knocked", "knock: {at_s: 1.0, yaw_deg: 2.0}")
    camera = knocked.frame(15).camera
    assert camera is not None
    assert np.array_equal(camera.T_camera_ego, sound.frame(15).camera.T_camera_ego)  # type: ignore[union-attr]
    assert _red_columns(knocked.frame(5)) == pytest.approx(_red_columns(sound.frame(5)), abs=2)
    moved_px = np.subtract(_red_columns(knocked.frame(15)), _red_columns(sound.frame(15)))
    assert moved_px == pytest.approx([camera.K[0, 0] * np.tan(np.radians(2.0))] * 2, abs=4.0)


def test_a_late_image_shows_the_world_of_later(tmp_path: Path) -> None:
    sound, late = _with_faults(tmp_path, "sound", ""), _with_faults(tmp_path, "late", "camera_skew_ms: 200")
    width = [np.ptp(_red_columns(source.frame(index))) for source, index in ((sound, 10), (late, 10), (sound, 12))]
    assert width[0] < width[1]
    assert width[1] == pytest.approx(width[2], abs=1)


def test_lost_images_are_missing(tmp_path: Path) -> None:
    source = _with_faults(tmp_path, "lossy", "pictures_lost: 0.5")
    frames = [source.frame(index) for index in range(len(source))]
    assert 4 <= sum(frame.image is None for frame in frames) <= 16
    assert all(frame.sweep is not None and frame.camera is not None for frame in frames)


def test_gnss_tells_the_way_driven(frames: dict[int, Frame]) -> None:
    first, last = frames[0].gnss, frames[100].gnss
    assert first is not None
    assert last is not None
    assert first.t_ns == frames[0].t_ns
    driven_m = np.hypot((last.lat_deg - first.lat_deg) * 110_950.0, (last.lon_deg - first.lon_deg) * 90_540.0)
    assert driven_m == pytest.approx(180.0, abs=3.0)  # 20 m/s for 4.5 s, then down to 12.8 m/s at 10 s
    assert first.quality == "rtk_fixed"
