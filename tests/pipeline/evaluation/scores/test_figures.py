"""How drives make figures, how sure those are, and how two runs compare."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.evaluation.scores.drive import DriveScore, Rules, score_drive
from pipeline.evaluation.scores.figures import FIGURES, Interval, bootstrap, compare, measure, ratio
from pipeline.evaluation.scores.report import as_json, sections
from pipeline.evaluation.scores.worst import changed, worst
from tests.pipeline.build import fused
from tests.pipeline.evaluation.scores.drives import believed, truth


def drive(offsets: list[float | None], uri: str = "made:1") -> DriveScore:
    """A lead 40 m ahead that approaches by 1 m per frame, and the CIPV's distance error in each; None: no CIPV."""
    known = truth(*({1: (40.0 - n, 0.0)} for n in range(len(offsets))), uri=uri)
    results = [
        believed(n, [fused(7, 40.0 - n + off)] if off is not None else [], 7 if off is not None else None)
        for n, off in enumerate(offsets)
    ]
    return score_drive(results, known, Rules())


def value(name: str, *drives: DriveScore) -> float | None:
    return next(each.of(drives) for each in FIGURES if each.name == name)


@pytest.mark.parametrize(
    ("offsets", "name", "expected"),
    [
        pytest.param([0.0, 0.0, 0.0, None], "cipv_correct", 75.0, id="three of four are right"),
        pytest.param([0.0, 0.0, 0.0, None], "lead_missed", 25.0, id="one is missed"),
        pytest.param([0.0, -20.0], "cipv_wrong", 50.0, id="far too near is wrong"),
        pytest.param([0.5, -1.5], "lead_distance", 1.0, id="sizes of errors, not errors"),
        pytest.param([0.5, -1.5], "distance", 1.0, id="of every vehicle the same"),
        pytest.param([None, None, 0.0], "acquired_s", 0.2, id="acquired after"),
        pytest.param([None, 0.0], "acquired_m", 39.0, id="acquired at"),
        pytest.param([0.0, None, 0.0, None, 0.0, 0.0, 0.0], "drop_outs", 200.0, id="two in 0.6 s"),
        pytest.param([0.0], "switches", None, id="one frame lasts no time"),
        pytest.param([0.0, 0.0], "cut_in_latency", None, id="nobody cut in"),
        pytest.param([0.0, 0.0], "warning_false", None, id="no ego speed, no brake to judge"),
    ],
)
def test_figures(offsets: list[float | None], name: str, expected: float | None) -> None:
    assert value(name, drive(offsets)) == (None if expected is None else pytest.approx(expected, abs=1e-6))


def test_drives_weigh_by_what_was_judged_in_them() -> None:
    assert value("cipv_correct", drive([0.0] * 9), drive([None])) == pytest.approx(90.0)


def test_every_figure_has_its_own_name() -> None:
    assert len({figure.name for figure in FIGURES}) == len(FIGURES)


def test_one_drive_has_no_interval_and_equal_ones_have_a_point() -> None:
    assert all(each.interval is None for each in measure([drive([0.0, None])]))
    correct = measure([drive([0.0, None]), drive([0.0, None])])[0]
    assert correct.interval == Interval(50.0, 50.0)


def test_the_interval_of_two_drives_reaches_from_one_to_the_other() -> None:
    """A quarter of the draws contains the same drive twice."""
    assert bootstrap([(0.0, 1.0), (10.0, 1.0)], ratio) == Interval(0.0, 10.0)


@given(st.lists(st.tuples(st.floats(0, 100), st.floats(1, 10)), min_size=2, max_size=6))
def test_intervals_are_the_same_every_time_and_in_order(parts: list[tuple[float, float]]) -> None:
    first = bootstrap(parts, ratio)
    assert first == bootstrap(parts, ratio)
    assert first is not None
    ratios = [over / under for over, under in parts]
    assert min(ratios) - 1e-9 <= first.low <= first.high <= max(ratios) + 1e-9


def test_more_drives_are_surer() -> None:
    few, many = (bootstrap([(0.0, 1.0), (10.0, 1.0)] * times, ratio) for times in (1, 20))
    assert few is not None
    assert many is not None
    assert many.high - many.low < 0.6 * (few.high - few.low)


def test_two_runs_are_compared_drive_by_drive() -> None:
    """Drives differ far more than runs: only pairing shows that the run is better in every drive."""
    base = [drive([2.0, 2.0]), drive([0.5, 0.5])]
    run = [drive([1.8, 1.8]), drive([0.3, 0.3])]
    by_name = {each.figure.name: each for each in compare(base, run)}
    error = by_name["lead_distance"]
    assert (error.base, error.run) == (pytest.approx(1.25), pytest.approx(1.05))
    assert error.difference == pytest.approx(-0.2)
    assert error.interval is not None
    assert error.interval.high < 0.0


def test_worst_frames_first() -> None:
    score = drive([0.1, None, -1.0, 0.0, -25.0])
    assert [(bad.name, bad.verdict) for bad in worst([score], 9)] == [
        ("000004", "wrong"),
        ("000001", "missed"),
        ("000002", "correct"),
        ("000000", "correct"),
    ]
    assert len(worst([score], 2)) == 2


def test_frames_that_changed_the_worse_ones_first() -> None:
    base, run = drive([0.0, None, 0.0]), drive([0.0, 0.0, None])
    assert [(bad.name, bad.before, bad.verdict) for bad in changed([base], [run], 9)] == [
        ("000002", "correct", "missed"),
        ("000001", "missed", "correct"),
    ]


def test_the_report_tells_every_figure_and_leads_to_the_frames() -> None:
    run = [drive([0.0, None, 0.4], uri="made:1"), drive([0.0, 0.0, 0.0], uri="made:2")]
    base = [drive([0.0, None, None], uri="made:1"), drive([0.0, 0.0, 0.0], uri="made:2")]
    told = {section.name: section for section in sections(run, lambda uri, index: f"{uri}@{index}", base)}
    assert [row[0] for row in told["scores"].tables[0].rows] == [figure.title for figure in FIGURES]
    assert [cell.href for cell, *_ in told["worst"].tables[0].rows] == ["made:1@1", "made:1@2"]  # type: ignore[union-attr]
    assert [row[0].value for row in told["comparison"].tables[1].rows] == ["000002"]  # type: ignore[union-attr]
    errors = told["errors"].tables[0].rows
    assert [row[:3] for row in errors] == [
        ("all", "any", 5),
        ("all", "VL", 5),
        ("30–40 m", "any", 3),
        ("30–40 m", "VL", 3),
        ("40–50 m", "any", 2),
        ("40–50 m", "VL", 2),
    ]
    assert errors[0][3:6] == (pytest.approx(0.0), pytest.approx(0.4), pytest.approx(0.08))


def test_the_same_in_json() -> None:
    told = as_json([drive([0.0, None, 0.4])], [drive([0.0, None, None])])
    assert told["figures"]["cipv_correct"]["value"] == pytest.approx(200 / 3)
    assert told["against"]["cipv_correct"]["difference"] == pytest.approx(100 / 3)
    assert told["drives"][0]["worst"][0] == {"frame": "000001", "index": 1, "verdict": "missed", "error_m": None}


@pytest.mark.parametrize(("drives", "word"), [(2, ""), (6, "better")])
def test_better_is_said_from_enough_drives_on(drives: int, word: str) -> None:
    base, run = ([drive([off, off])] * drives for off in (0.5, 0.3))
    rows = sections(run, lambda uri, index: uri, base)[0].tables[0].rows
    assert next(row[-1] for row in rows if row[0] == "distance error of the lead") == word
