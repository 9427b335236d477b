"""What a run stores of its results is enough to score it and to propose labels from it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.drive.full_run import DriveRun
from app.drive.open_recording import RULE
from app.drive.run_results import results_of, seen_of
from pipeline.detection import Detectors, detect
from pipeline.evaluation.scores.drive import Rules, score_drive
from pipeline.evaluation.scores.figures import FIGURES
from pipeline.evaluation.scores.truth import of_source
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.types import Result
from tests.app.engine.recording_helpers import CountingDetector, Recording


def test_a_runs_score_is_the_one_of_its_results(data_dir: Path) -> None:
    source = open_source(f"astyx:{data_dir / 'astyx'}")
    kept = DriveRun(1, Params(), "default", len(source))
    state, results = State(), []
    for index in range(len(source)):
        frame = replace(source.frame(index), image=None)
        state, result = step(state, frame, Params())
        results.append(result)
        kept.add(frame, source.truth(index), RULE)
    truth = of_source(source, RULE)
    whole, again = (score_drive(each, truth, Rules(RULE)) for each in (results, results_of(kept)))
    assert [frame.judged and frame.judged.verdict for frame in whole.frames] == [
        frame.judged and frame.judged.verdict for frame in again.frames
    ]
    values = {figure.name: (figure.of([whole]), figure.of([again])) for figure in FIGURES}
    assert sum(value is not None for value, _ in values.values()) > 10
    for value, kept_value in values.values():
        assert kept_value == (None if value is None else pytest.approx(value, abs=1e-4))


def test_every_object_comes_back() -> None:
    """Objects of both sensors, of one and of none: the fields that labels and scores read."""
    recording, detector = Recording(), CountingDetector()
    kept = DriveRun(1, Params(), "default", 6)
    state, wanted = State(), []
    for index in range(6):
        frame = detect(recording.frame(index), Detectors(detector))
        frame = replace(frame, sweep=None) if index < 3 else frame
        state, result = step(state, frame, Params())
        wanted.append(result)
        kept.add(frame, None, RULE)
    assert {each.source for result in wanted for each in result.objects} == {"VL", "V"}
    for result, back in zip(wanted, results_of(kept), strict=True):
        assert (back.t_ns, _lead(back)) == (result.t_ns, _lead(result))
        for one, other in zip(result.objects, back.objects, strict=True):
            assert (other.id, other.source, other.label, other.carried, other.hits, other.in_path) == (
                one.id, one.source, one.label, one.carried, one.hits, one.in_path,
            )  # fmt: skip
            assert other.bbox == pytest.approx(one.bbox, abs=1e-3) if one.bbox else other.bbox is None
            assert (other.cuboid is None, other.bev is None) == (one.cuboid is None, one.bev is None)
            if one.cuboid is not None and other.cuboid is not None:
                assert other.cuboid.center == pytest.approx(one.cuboid.center, abs=1e-3)
    first = seen_of(kept.objects()[0][1])
    assert [(each.id, each.label, each.cuboid) for each in first] == [(wanted[0].objects[0].id, "car", None)]


def _lead(result: Result) -> int | None:
    return result.cipv.id if result.cipv is not None else None
