"""The robustness suite: the same drives whoever drives them, and a pipeline that is broken on purpose shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.evaluation.report_sections import as_json
from pipeline.experiments.robustness import traffic
from pipeline.experiments.robustness.experiment import (
    AS_IS,
    VARIANTS,
    DriveOutcome,
    Kilometre,
    as_drive,
    poisson_bounds,
    report,
    run,
    suite,
)
from pipeline.experiments.robustness.judge import Failure
from pipeline.params import Params, flat, preset, with_changes
from pipeline.simulation.drive_as_scenario import to_yaml
from pipeline.simulation.scenario import Scenario
from pipeline.simulation.unseen import frames
from pipeline.sources.simulated import SimulatedSource
from pipeline.step import State, step

BROKEN = "no existence estimate"
SHORT_S = 8.0


@pytest.fixture
def short_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives of 100 or 200 m instead of a kilometre."""
    whole = traffic.scenario

    def short(seed: int, number: int) -> Scenario:
        return whole(seed, number).model_copy(update={"duration_s": SHORT_S})

    monkeypatch.setattr(traffic, "scenario", short)


@pytest.mark.usefixtures("short_drives")
def test_without_weighing_existence_there_are_more_phantoms_on_the_same_frames() -> None:
    together = run(Kilometre(1, 6, (AS_IS, BROKEN)))
    assert _phantom_s(together, BROKEN) > _phantom_s(together, AS_IS)
    assert run(Kilometre(1, 6)).failures[AS_IS] == together.failures[AS_IS]  # whatever was driven before or beside


def _phantom_s(outcome: DriveOutcome, variant: str) -> float:
    return sum(each.lasts_s + 0.1 for each in outcome.failures[variant] if each.kind.startswith("phantom"))


def test_a_kept_drive_opens_and_gives_the_same_results(tmp_path: Path) -> None:
    case = Kilometre(3, 4)
    outcome = DriveOutcome(1.0, 60.0, {AS_IS: (Failure("phantom lead", "nothing there, by camera", 0.2, 0.5, "#1"),)})
    drive = as_drive(case, outcome)
    assert drive is not None
    file = tmp_path / f"{drive.name}.yaml"
    file.write_text(to_yaml(drive.as_seen(), "kept"), encoding="utf-8")
    source = SimulatedSource(f"sim:{file}", str(file))
    here = there = State()
    for _, frame in frames(traffic.scenario(3, 4)):
        if frame.index == 4:
            break
        here, driven = step(here, frame, drive.params)
        there, opened = step(there, source.frame(frame.index), drive.params)
        assert (driven.objects, driven.cipv) == (opened.objects, opened.cipv)
        assert driven.layers.points.tolist() == opened.layers.points.tolist()


def test_a_drive_without_a_failure_is_not_kept() -> None:
    assert as_drive(Kilometre(0, 0), DriveOutcome(1.0, 60.0, {AS_IS: ()})) is None


def test_rates_come_with_bounds_and_a_demand_fails_only_when_it_surely_does() -> None:
    assert poisson_bounds(0) == pytest.approx((0.0, 3.689), abs=1e-3)  # Garwood's table
    assert poisson_bounds(10) == pytest.approx((4.795, 18.390), abs=1e-3)
    full = Failure("phantom full braking", "nothing there, by camera", 1.0, 1.4, "#7")
    missed = Failure("lead missed", "no lead, true lead within 20 m", 3.0, 4.0, "car 1")
    cases = [Kilometre(0, number) for number in range(2)]
    outcomes = [DriveOutcome(1.0, 60.0, {AS_IS: (full, missed)}), DriveOutcome(1.0, 60.0, {AS_IS: ()})]
    section = report(cases, outcomes)
    rows = {row[0]: row for row in as_json(section)["tables"][0]["rows"]}
    assert rows["phantom full braking"][1:3] == [1, 500.0]
    assert [failure.split(":")[0] for failure in section.failures] == ["phantom full braking", "lead missed"]


def test_cases_are_numbered_kilometres_and_every_variant_is_a_parameter() -> None:
    assert [case.number for case in suite(4, seed=2).cases(False)] == [0, 1, 2, 3]
    assert len(suite(4).cases(True)) < 4
    assert suite(1, ablation=True).cases(False)[0].variants == tuple(VARIANTS)
    for name, changes in VARIANTS.items():
        assert (with_changes(Params(), changes) == Params()) == (name == AS_IS)


@pytest.mark.parametrize(
    "name",
    [
        "clusters nearer than their track not split",
        "wide clusters taken for vehicles",
        "ACC acts on an unknown speed at once",
        "unconfirmed leads kept unseen",
        "kept where sensors contradict each other",
        "boxes widen what drives along",
        "returns over the roof range",
        "first clusters contradict the camera",
        "braking for what was in the path",
        "braking for what crosses over",
        "camera speeds without error",
    ],
)
def test_a_rule_that_the_paper_does_not_have_is_off_in_its_preset(name: str) -> None:
    paper = flat(preset("paper"))
    assert {key: paper[key] for key in VARIANTS[name]} == VARIANTS[name]


@pytest.mark.parametrize("number", range(12))
def test_any_number_is_a_drive_in_which_nobody_is_hit(number: int) -> None:
    """The scripted ego vehicle keeps its distance from every vehicle."""
    from pipeline.simulation.world import world_state

    scene = traffic.scenario(5, number)
    for t_s in range(0, int(scene.duration_s), 2):
        for state in world_state.at(scene, float(t_s)).actors:
            x, y = state.cuboid.footprint().T
            assert not (x.min() < -0.5 < x.max() and y.min() < 0.0 < y.max()), (number, t_s, state.actor.id)
