"""A part of a drive as a file of each kind: it holds the frames that the page shows."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from app.clips.clip import Clip
from app.clips.export_queue import ExportQueue
from app.clips.exports import MOST_FRAMES, submit, write_clip
from app.clips.html_report import worth_an_image
from app.clips.overlay import WIDTH_PX, draw_frame
from app.core.detection_cache import DetectionCache
from app.core.playback_clock import timeline_s
from app.drive.compute_scheduler import ComputeScheduler
from app.drive.events.event import Event
from app.drive.open_recording import OpenRecording, RunSetup
from app.views.colors import rgb
from pipeline.common.errors import BadInput
from pipeline.detection import Detectors, detector_for
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import CameraImage, Frame, Result
from pipeline.types.result_json import to_json
from tests.app.engine.recording_helpers import HEIGHT, WIDTH, CountingDetector, Recording

FIRST, LAST = 12, 19
Results = list[tuple[Frame, Result]]


@pytest.fixture(scope="module")
def results() -> Results:
    return list(run(Recording(), Params(), Detectors(CountingDetector())))


@pytest.fixture
def clip() -> Clip:
    """Eight frames from the middle; the whole drive has not been computed yet."""
    source = Recording()
    times = timeline_s([source.t_ns(i) for i in range(len(source))], source.rate_hz)
    setup = RunSetup(source, times, Detectors(CountingDetector()), "both")
    recording = OpenRecording(setup, DetectionCache(), 1)
    return Clip(recording, Params(), FIRST, LAST, ComputeScheduler(), source.title, source.rate_hz)


@pytest.fixture
def written(clip: Clip, tmp_path: Path) -> Callable[[str], Path]:
    """Write the clip; progress ends at its total."""

    def write(kind: str) -> Path:
        told: list[tuple[int, int]] = []
        path = tmp_path / f"clip.{kind}"
        write_clip(clip, kind, path, lambda done, total: told.append((done, total)))
        assert told[-1] in {(LAST + 1 - FIRST,) * 2, (LAST + 1,) * 2}, (
            "its frames, and where they are run, those before"
        )
        assert [done for done, _ in told] == sorted(done for done, _ in told)
        return path

    return write


def test_a_table_has_the_drives_own_numbers(written: Callable[[str], Path], results: Results):
    with written("csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    expected = [to_json(result) for _, result in results[FIRST : LAST + 1]]
    assert [row["frame"] for row in rows if row["is_cipv"] == "True"] == [each["frame"] for each in expected]
    assert [float(row["distance_m"]) for row in rows if row["is_cipv"] == "True"] == [
        each["cipv"]["distance_m"] for each in expected
    ]
    assert [int(row["hits"]) for row in rows if row["is_cipv"] == "True"] == [
        item["hits"] for each in expected for item in each["objects"] if item["id"] == each["cipv"]["id"]
    ], "the state goes back to the drive's beginning, not to the clip's"


def test_a_session_can_be_opened_again(written: Callable[[str], Path]):
    source = open_source(str(written("mcap")))
    assert len(source) == LAST + 1 - FIRST
    original, kept = Recording().frame(FIRST), source.frame(0)
    assert kept.sweep is not None
    assert original.sweep is not None
    np.testing.assert_allclose(kept.sweep.points, original.sweep.points, atol=1e-6)


def test_a_film_plays_at_the_drives_own_times(written: Callable[[str], Path]):
    with av.open(str(written("mp4"))) as film:
        video = film.streams.video[0]
        frames = list(film.decode(video))
        assert (video.codec_context.name, video.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (video.width, video.height) == (WIDTH, HEIGHT)
    assert [frame.time for frame in frames] == pytest.approx([0.1 * n for n in range(LAST + 1 - FIRST)], abs=0.002)
    drawn = frames[-1].to_ndarray(format="rgb24").astype(int)
    green = np.abs(drawn - np.array(rgb("cipv"))).sum(axis=2) < 120
    assert green.sum() > 30, "the lead's box is in the film"


def test_a_page_tells_loads_nothing_and_says_what_it_was_made_with(written: Callable[[str], Path], clip: Clip):
    text = written("html").read_text(encoding="utf-8")
    assert "Frames 000012 to 000019 (8) of test:car." in text
    assert "acquired at" in text
    assert "Distance to the CIPV" in text
    assert clip.recording.digest(Params()) in text
    assert "confirm_hits: 3" in text
    assert text.count('src="data:image/jpeg;base64,') == 2, "where it begins, and the shortest TTC"
    assert not re.search(r'(src|href)="(?!data:|#)', text)


def test_a_replay_is_written(written: Callable[[str], Path]):
    assert written("rrd").read_bytes()[:4] == b"RRF2"


@pytest.mark.parametrize(("first", "last"), [(5, 4), (0, 30), (-1, 3)], ids=["backwards", "beyond", "before"])
def test_what_is_no_clip_is_refused(clip: Clip, first: int, last: int):
    jobs = ExportQueue()
    with pytest.raises(BadInput, match="a clip must start and end"):
        submit(jobs, Clip(**{**vars(clip), "first": first, "last": last}), "csv")
    jobs.close()


def test_a_clip_that_is_too_long_is_refused(clip: Clip):
    clip.recording.setup.__dict__["timeline_s"] = np.arange(MOST_FRAMES + 1) / 10.0
    with pytest.raises(BadInput, match="at most"):
        submit(ExportQueue(), Clip(**{**vars(clip), "first": 0, "last": MOST_FRAMES}), "csv")


# ---------------------------------------------------------------- what is drawn


def test_a_large_image_is_made_smaller_and_even(results: Results):
    frame, result = results[5]
    large = Frame(**{**vars(frame), "image": CameraImage(None, np.full((621, 2049, 3), 90, np.uint8))})
    height, width = draw_frame(large, result, Params()).shape[:2]
    assert width == WIDTH_PX
    assert (height % 2, abs(height - 621 * WIDTH_PX / 2049) <= 2) == (0, True)


def test_a_frame_without_an_image_says_so(results: Results):
    frame, result = results[5]
    drawn = draw_frame(Frame(**{**vars(frame), "image": None}), result, Params())
    assert drawn.shape == (720, 1280, 3)
    assert drawn.any()


def test_the_source_image_is_not_drawn_on(results: Results):
    frame, result = results[5]
    assert frame.image is not None
    before = frame.image.bgr.copy()
    draw_frame(frame, result, Params())
    assert np.array_equal(before, frame.image.bgr)


def test_images_are_of_the_weightiest_events():
    events = [Event("cipv_switch", n, f"switch {n}", severity="info") for n in range(10)]
    chosen = worth_an_image([*events, Event("brake", 15, "full braking", severity="alarm")])
    assert list(chosen) == [0, 1, 2, 3, 15]
    assert chosen[15] == "full braking"
    assert worth_an_image([]) == {0: "start of the clip"}


def test_a_real_clip_looks_as_it_should(data_dir: Path):
    """Astyx 183: the box of the lead is drawn in the lead's colour where the detector has it."""
    source = open_source(f"astyx:{data_dir / 'astyx'}")
    detector = detector_for(source, str(data_dir / "models" / "yolox_nano.onnx"))
    times = timeline_s([source.t_ns(i) for i in range(len(source))], source.rate_hz)
    setup = RunSetup(source, times, Detectors(detector), "both")
    recording = OpenRecording(setup, DetectionCache(), 1)
    frame = recording.frame(17)
    _, result = step(State(), frame, Params())
    drawn = draw_frame(frame, result, Params())
    assert result.cipv is not None
    x1, _, x2, y2 = (round(v * drawn.shape[1] / 2048) for v in result.layers.vision_boxes[result.cipv.id])
    edge = cv2.cvtColor(drawn, cv2.COLOR_BGR2RGB)[y2, (x1 + x2) // 2].astype(int)
    assert np.abs(edge - np.array(rgb("cipv"))).sum() < 60
