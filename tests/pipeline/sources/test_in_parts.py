"""A frame in parts is the frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.recording.session.frame_record import CameraRecord
from pipeline.sources import open_source
from pipeline.types import Frame
from pipeline.types.source import InParts, Source
from tests.pipeline.recording.frames import full, write
from tests.pipeline.sources.made.bags import write_bag
from tests.pipeline.sources.made.captures import write_capture
from tests.pipeline.sources.made.clouds_on_disk import write_clouds


@pytest.fixture(params=["session", "astyx", "kitti", "simulated", "rosbag", "pcap", "pcd"])
def source(request: pytest.FixtureRequest, tmp_path: Path) -> Source:
    if request.param == "rosbag":
        return open_source(f"rosbag:{write_bag(tmp_path / 'drive')}")
    if request.param == "pcap":
        return open_source(f"pcap:{write_capture(tmp_path / 'drive') / 'drive.pcap'}")
    if request.param == "pcd":
        return open_source(f"pcd:{write_clouds(tmp_path / 'drive')}")
    if request.param == "session":
        return open_source(str(write(tmp_path / "drive.mcap", [full(index) for index in range(3)])))
    if request.param == "simulated":
        return open_source("sim:straight")
    folder = request.getfixturevalue("data_dir") / {"astyx": "astyx", "kitti": "kitti_0052"}[request.param]
    if not folder.is_dir():
        pytest.skip(f"no recording at {folder}")
    return open_source(f"{request.param}:{folder}")


def test_a_frame_in_parts_is_the_frame(source: Source) -> None:
    assert isinstance(source, InParts)
    outlines = list(source.outlines())
    assert len(outlines) == len(source)
    for index in (0, len(source) - 1):
        whole, outline, sweep = source.frame(index), outlines[index], source.sweep(index)
        assert _small(outline) == _small(whole)
        assert (outline.sweep, outline.image, outline.route) == (None, None, None)
        assert whole.sweep is not None
        assert sweep is not None
        np.testing.assert_array_equal(sweep.points, whole.sweep.points)
        assert (sweep.t_ns, sweep.channels) == (whole.sweep.t_ns, whole.sweep.channels)


def _small(frame: Frame) -> tuple[object, ...]:
    camera = CameraRecord.of(frame.camera, 0) if frame.camera is not None else None
    return frame.index, frame.name, frame.t_ns, camera, frame.ego, frame.gnss, frame.streams, frame.timing_ms
