"""The law fitted in the scene is the scene's, and the law used by the other experiments is the same."""

from __future__ import annotations

import pytest

from pipeline.evaluation.report_sections import Table
from pipeline.experiments.paper.distance_regression import report, run
from pipeline.experiments.paper.layouts import LayoutCase, cases, scenario
from pipeline.simulation.sensors import truth_boxes


@pytest.fixture(scope="module")
def laws() -> Table:
    chosen = [*cases(False)[:8], *(LayoutCase(layout, seed) for layout in "bc" for seed in range(6))]
    return report(chosen, [run(case) for case in chosen]).tables[0]


def row(table: Table, name: str) -> tuple[float, ...]:
    return next(tuple(cells[1:]) for cells in table.rows if cells[0] == name)  # type: ignore[arg-type]


def test_the_fit_finds_the_law_that_the_experiments_use(laws: Table) -> None:
    coefficient, exponent, *_ = row(laws, "fitted, exponent −1")
    assert exponent == -1.0
    assert coefficient == pytest.approx(truth_boxes.LAW.coefficient, rel=0.03)
    assert row(laws, "fitted, free exponent")[1] == pytest.approx(-1.0, abs=0.05)


def test_a_law_fitted_here_beats_one_from_elsewhere(laws: Table) -> None:
    fitted, default = row(laws, "fitted, exponent −1"), row(laws, "of YOLOX on real cars")
    assert all(ours < theirs for ours, theirs in zip(fitted[2:], default[2:], strict=True))
    assert max(fitted[2:]) < 10.0


def test_layouts_stand_where_they_say_and_cars_differ_from_run_to_run() -> None:
    scenes = {layout: scenario(LayoutCase(layout, 0)) for layout in "abc"}
    lanes = {layout: scene.actors[0].lane - scene.ego.lane for layout, scene in scenes.items()}
    assert lanes == {"a": 0, "b": 1, "c": 2}
    assert len({scenario(LayoutCase("a", seed)).actors[0].size_m for seed in range(5)}) == 5
