"""``results.jsonl`` read back: the same scores as of the results themselves, one clear error for anything else."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.errors import BadInput
from pipeline.evaluation.scores.drive import Rules, score_drive
from pipeline.evaluation.scores.results_file import read_results
from pipeline.types import Result
from pipeline.types.result_json import to_line
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import believed, truth

PLACES = ({1: (40.0, 0.0)}, {1: (39.0, 0.0)}, {1: (38.0, 0.0)})
RESULTS: list[Result] = [
    believed(0, [fused(7, 40.25)], 7, "follow"),
    believed(1, [fused(7, 39.5, source="V"), fused(8, None, source="V"), fused(9, 12.0, 5.0, source="L")], 7, "warn"),
    believed(2, [], None, None),
]


def written(folder: Path, lines: list[str]) -> Path:
    file = folder / "results.jsonl"
    file.write_text("".join(lines), encoding="utf-8")
    return file


def test_a_file_scores_as_the_results_do(tmp_path: Path) -> None:
    read = read_results(written(tmp_path, [to_line(result) for result in reversed(RESULTS)]))
    known = truth(*PLACES)
    a, b = (score_drive(results, known, Rules()) for results in (RESULTS, read))
    assert b.acquisitions == a.acquisitions
    assert b.alarms == a.alarms
    assert b.switches == a.switches
    for one, other in zip(a.frames, b.frames, strict=True):
        assert (other.judged is None) == (one.judged is None)
        assert other.judged is not None
        assert one.judged is not None
        assert other.judged.verdict == one.judged.verdict
        assert other.judged.distance_m == pytest.approx(one.judged.distance_m, abs=1e-3)
        assert [e.source for e in other.errors] == [e.source for e in one.errors]


def test_results_of_another_recording(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="another recording"):
        score_drive([believed(50, [], None)], truth(*PLACES), Rules())


GOOD = json.loads(to_line(RESULTS[1]))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        pytest.param("", "no results", id="empty"),
        pytest.param("not json\n", "line 1", id="no JSON"),
        pytest.param("[]\n", "line 1", id="no object"),
        pytest.param("{}\n", "line 1", id="nothing in it"),
        pytest.param(json.dumps({**GOOD, "version": 2}) + "\n", "version 2", id="another version"),
        pytest.param(to_line(RESULTS[0]) + "{}\n", "line 2", id="the second line"),
        pytest.param(to_line(RESULTS[0]) * 2, "two results with the same time", id="two runs in one file"),
        pytest.param("[" * 100_000 + "\n", "line 1", id="nested without end"),
        pytest.param(json.dumps(GOOD).replace("39.5", "NaN") + "\n", "line 1", id="not a number"),
        pytest.param(json.dumps(GOOD).replace("39.5", "1e999") + "\n", "line 1", id="beyond all numbers"),
        pytest.param(json.dumps({**GOOD, "objects": [5]}) + "\n", "line 1", id="objects that are none"),
        pytest.param(json.dumps({**GOOD, "acc": {**GOOD["acc"], "state": "fly"}}) + "\n", "line 1", id="no such state"),
        pytest.param(json.dumps({**GOOD, "cipv": {"id": 7}}) + "\n", "line 1", id="half a CIPV"),
    ],
)
def test_what_is_no_results_file(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(BadInput, match=named):
        read_results(written(tmp_path, [text]))


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    file = tmp_path / "results.jsonl"
    file.write_bytes(b"\xff\xfe\x00binary")
    with pytest.raises(BadInput, match="not a text file"):
        read_results(file)


@given(st.integers(0, 900), st.integers(0, 900), st.text(max_size=8))
def test_a_damaged_line_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, a: int, b: int, put: str) -> None:
    line = to_line(RESULTS[1])
    file = written(tmp_path_factory.mktemp("damaged"), [line[: min(a, b)] + put + line[max(a, b) :]])
    try:
        results = read_results(file)
    except BadInput:
        return
    score_drive([believed(0, [], None), *results], truth(*PLACES), Rules())  # what is read can be judged
