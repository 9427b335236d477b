"""The simulator as a source."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.alignment.projection import project_cuboid, resolve
from pipeline.params import AlignmentParams
from pipeline.sources import SourceError, open_source
from pipeline.types import Frame


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


def test_gnss_tells_the_way_driven(frames: dict[int, Frame]) -> None:
    first, last = frames[0].gnss, frames[100].gnss
    assert first is not None
    assert last is not None
    assert first.t_ns == frames[0].t_ns
    driven_m = np.hypot((last.lat_deg - first.lat_deg) * 110_950.0, (last.lon_deg - first.lon_deg) * 90_540.0)
    assert driven_m == pytest.approx(180.0, abs=3.0)  # 20 m/s for 4.5 s, then down to 12.8 m/s at 10 s
    assert first.quality == "rtk_fixed"
