"""Which detectors process a source's images, and what the page says about it."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.commands.support.options import PipelineOptions
from app.engine.detector_pool import DetectorPool
from app.engine.snapshot import Notice
from pipeline.common.errors import BadInput
from pipeline.detection import Detectors
from pipeline.inference.runtime import DetectorMissing
from pipeline.lanes.classical import open_classical
from pipeline.lanes.network import open_lane_network
from pipeline.lanes.open_detector import usual_every
from pipeline.simulation import scenario
from pipeline.simulation.drive_as_scenario import to_yaml
from pipeline.sources import open_source
from tests.app.engine.recording_helpers import CountingDetector, Recording
from tests.pipeline.lanes import lane_networks


def both(open_lanes, sensors="both", every: int | None = None) -> tuple[Detectors, list[Notice]]:
    notices: list[Notice] = []
    pool = DetectorPool(lambda _: CountingDetector(), sensors, open_lanes, every)
    return pool.both_for(Recording(), notices), notices


def test_the_page_says_which_lane_detector_works() -> None:
    detectors, notices = both(lambda _: open_classical(None))
    assert detectors.lanes is not None
    assert detectors.lanes.name == "classical"
    assert [notice.level for notice in notices] == ["info"]
    assert "Lane lines by colour and gradient" in notices[0].text


def test_a_missing_lane_network_is_said_and_boxes_go_on() -> None:
    def missing(_: object):
        raise DetectorMissing("No lane network 'x'.")

    detectors, notices = both(missing)
    assert detectors.boxes is not None
    assert detectors.lanes is None
    assert notices == [Notice("warning", "No lane network 'x'. No lane detection.")]


def test_lidar_alone_opens_no_detector() -> None:
    detectors, notices = both(lambda _: open_classical(None), "lidar")
    assert (detectors.boxes, detectors.lanes, notices) == (None, None, [])


def test_nothing_is_opened_for_a_drive_that_brings_its_detections(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "kept.yaml"
    scene = scenario.load("straight").model_copy(update={"sensors": "lidar"})
    file.write_text(to_yaml(scene), encoding="utf-8")
    source = open_source(f"sim:{file}")
    notices: list[Notice] = []
    pool = DetectorPool(lambda _: pytest.fail("opened"), "both", lambda _: pytest.fail("opened"))
    assert pool.both_for(source, notices) == PipelineOptions().open_detectors(source) == Detectors()
    assert (notices, capsys.readouterr().err) == ([], "")


def test_a_network_looks_less_often_unless_told_otherwise(tmp_path: Path) -> None:
    network = open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx")))
    assert both(lambda _: network)[0].lanes_every == 3
    assert both(lambda _: network, every=1)[0].lanes_every == 1
    assert both(lambda _: open_classical(None))[0].lanes_every == 1


@pytest.mark.parametrize(("rate_hz", "every"), [(2.0, 1), (3.3, 1), (5.0, 1), (7.0, 2), (10.0, 3), (30.0, 3)])
def test_a_network_looks_at_no_older_images_of_a_slow_recording(tmp_path: Path, rate_hz: float, every: int) -> None:
    network = open_lane_network(str(lane_networks.twin(tmp_path / "tiny.onnx")))
    assert usual_every(network, rate_hz) == every
    assert usual_every(open_classical(None), rate_hz) == 1


@pytest.mark.parametrize("every", [0, -2])
def test_a_rate_that_is_none_is_refused(every: int) -> None:
    with pytest.raises(BadInput, match=f"--lanes-every {every}"):
        PipelineOptions(lanes_every=every).open_detectors(Recording())
