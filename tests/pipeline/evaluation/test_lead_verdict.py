"""The judge itself: which labelled vehicle is the lead, and what each verdict means."""

from __future__ import annotations

import dataclasses

import pytest

from pipeline.decision.cipv import CipvState, choose
from pipeline.evaluation.lead_verdict import Judged, LeadRule, judge, score, true_lead
from pipeline.params import CipvParams, Params, PathParams
from pipeline.path.corridor import corridor
from pipeline.step import State, step
from pipeline.types import Frame, FusedObject, Result
from pipeline.types.source import TruthObject
from tests.pipeline.build import cuboid, fused, moment

RULE = LeadRule()
PATH = corridor(None, PathParams())


def labelled(x: float, y: float, label: str = "Car") -> TruthObject:
    return TruthObject(label, cuboid(x, y))


def believed(*objects: FusedObject) -> Result:
    judged, lead, _, rejected = choose(CipvState(), objects, PATH, moment(), CipvParams())[1]
    _, empty = step(State(), Frame(0, "000000", 0), Params())
    return dataclasses.replace(empty, objects=judged, cipv=lead, rejected=rejected)


@pytest.mark.parametrize(
    ("truth", "expected_x"),
    [
        pytest.param([labelled(40, 0), labelled(20, 0.5)], 20, id="nearest in lane"),
        pytest.param([labelled(10, 3.5), labelled(20, 0)], 20, id="next lane does not count"),
        pytest.param([labelled(10, 0, "Person"), labelled(20, 0)], 20, id="a person is no lead"),
        pytest.param([labelled(-20, 0), labelled(30, 0)], 30, id="behind does not count"),
        pytest.param([labelled(80, 0)], None, id="beyond the range asked for"),
        pytest.param([], None, id="nothing"),
    ],
)
def test_true_lead(truth: list[TruthObject], expected_x: float | None) -> None:
    lead = true_lead(truth, RULE)
    assert (lead.cuboid.center[0] - 2.0 if lead else None) == expected_x


@pytest.mark.parametrize(
    ("objects", "truth", "verdict"),
    [
        pytest.param([fused(1, 20.1)], [labelled(20, 0)], "correct", id="on it"),
        pytest.param([], [], "none", id="rightly nothing"),
        pytest.param([], [labelled(20, 0)], "missed", id="not found"),
        pytest.param([fused(1, 20.0)], [], "false", id="nothing there"),
        pytest.param([fused(1, 70.0)], [], "none", id="beyond the range asked for"),
        pytest.param([fused(1, 12.0)], [labelled(20, 0)], "wrong", id="something before it"),
        pytest.param([fused(1, 20.0, -1.4)], [labelled(20, 1.4)], "wrong", id="beside it"),
    ],
)
def test_verdicts(objects: list[FusedObject], truth: list[TruthObject], verdict: str) -> None:
    assert judge(believed(*objects), truth, RULE).verdict == verdict


def test_an_error_is_told_of_whatever_lies_in_the_leads_place_from_side_to_side() -> None:
    good = judge(believed(fused(1, 20.4)), [labelled(20, 0)], RULE)
    far_off = judge(believed(fused(1, 12.0)), [labelled(20, 0)], RULE)
    beside = judge(believed(fused(1, 20.0, -1.4)), [labelled(20, 1.4)], RULE)
    assert good.error_m == pytest.approx(0.4, abs=0.01)
    assert far_off.error_m == pytest.approx(-8.0, abs=0.01)
    assert beside.error_m is None


def test_score_counts_and_averages() -> None:
    rows = [
        Judged("a", "correct", 20.0, 21.0, 0.0),
        Judged("b", "correct", 40.0, 38.0, 0.0),
        Judged("c", "missed", 30.0, None, None),
        Judged("d", "none", None, None, None),
    ]
    total = score(rows)
    assert (total.frames, total.correct, total.missed, total.false, total.wrong) == (4, 3, 1, 0, 0)
    assert total.mean_error_m == pytest.approx(1.5)
    assert total.max_error_m == pytest.approx(2.0)
    assert total.mean_relative_error == pytest.approx(0.05)


def test_an_empty_drive_has_no_figures() -> None:
    assert score([]).mean_error_m is None
