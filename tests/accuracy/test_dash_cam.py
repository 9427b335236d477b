"""A dash cam on a motorway, nothing in its lane: the camera alone, without any calibration, must not invent a lead."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import through
from pipeline.sources import open_source
from tests import looking


def test_the_empty_road_is_no_car_as_wide_as_the_far_view(data_dir: Path) -> None:
    source = open_source(f"video:{data_dir / 'lane_images' / 'test_video.mp4'}")
    frames = [source.frame(index) for index in range(len(source))]
    assert frames[0].image is not None
    height, width = frames[0].image.bgr.shape[:2]
    boxes, far = looking.yolox_nano(data_dir, width, height), looking.far_view(data_dir, width, height)
    lanes = looking.lanes(source.uri, "twinlitenet")
    assert far is not None
    leads = {}
    for case, view in (("as it is", far), ("every box of the far view", replace(far, sure_px=float("inf")))):
        detectors = Detectors(boxes, lanes, 3, view, far_lanes=looking.far_lanes(source.uri, "twinlitenet"))
        results = [result for _, result in through(frames, Params(), detectors, "both")]
        leads[case] = [result.cipv.distance_m for result in results if result.cipv is not None]
    assert leads["as it is"] == []
    assert len(leads["every box of the far view"]) > 2, "the video shows it"
