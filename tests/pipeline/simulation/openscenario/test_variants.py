"""Distributions of parameter values: one value each, several to choose from, and values that the user gives."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation import scenario
from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import Parts, declared, init, on_lane

PARTS = Parts(
    parameters=declared("speed_kph", "36") + declared("gap", "50") + declared("_speed", "${$speed_kph/3.6}"),
    init=init("Ego", on_lane(-1, 100.0), "$_speed")
    + init("Lead", '<RelativeLanePosition entityRef="Ego" dLane="0" ds="$gap"/>', "0"),
)


def single(name: str, *values: str) -> str:
    elements = "".join(f'<Element value="{value}"/>' for value in values)
    return (
        f'<DeterministicSingleParameterDistribution parameterName="{name}"><DistributionSet>{elements}'
        "</DistributionSet></DeterministicSingleParameterDistribution>"
    )


def steps(name: str, step: str, low: str, high: str) -> str:
    return (
        f'<DeterministicSingleParameterDistribution parameterName="{name}"><DistributionRange stepWidth="{step}">'
        f'<Range lowerLimit="{low}" upperLimit="{high}"/></DistributionRange>'
        "</DeterministicSingleParameterDistribution>"
    )


def together(*sets: dict[str, str]) -> str:
    inside = "".join(
        "<ParameterValueSet>"
        + "".join(f'<ParameterAssignment parameterRef="{name}" value="{value}"/>' for name, value in each.items())
        + "</ParameterValueSet>"
        for each in sets
    )
    return (
        "<DeterministicMultiParameterDistribution><ValueSetDistribution>"
        f"{inside}</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    )


def speed_and_gap(folder: Path, distributions: str, options: str = "", file: str = "drive.xosc") -> tuple[float, float]:
    """Ego speed in km/h and distance between the reference points, of the scenario that a distribution gives."""
    PARTS.write(folder)
    path = folder / "variants.xosc"
    path.write_text(
        f'<OpenSCENARIO><ParameterValueDistribution><ScenarioFile filepath="{file}"/>'
        f"<Deterministic>{distributions}</Deterministic></ParameterValueDistribution></OpenSCENARIO>",
        encoding="utf-8",
    )
    made = scenario.load(f"{path}{options}")
    return made.ego.speed_mps[0.0] * 3.6, made.actors[0].ahead_m + 4.0


@pytest.mark.parametrize(
    ("distributions", "options", "expected"),
    [
        (single("speed_kph", "50"), "", (50, 50)),
        (single("speed_kph", "50", "60"), "?variant=2", (60, 50)),
        (single("speed_kph", "50", "60") + single("gap", "70", "80"), "?variant=2", (50, 80)),
        (single("speed_kph", "50", "60") + single("gap", "70", "80"), "?variant=3", (60, 70)),
        (steps("speed_kph", "5", "30", "40"), "?variant=3", (40, 50)),
        (steps("speed_kph", "0.1", "30", "30.3"), "?variant=4", (30.3, 50)),
        (together({"speed_kph": "72", "gap": "90"}), "", (72, 90)),
        (single("speed_kph", "50", "60"), "?speed_kph=70", (70, 50)),
        (single("speed_kph", "50", "60") + single("gap", "70", "80"), "?speed_kph=70&variant=2", (70, 80)),
    ],
)
def test_the_chosen_values_are_taken(
    tmp_path: Path, distributions: str, options: str, expected: tuple[float, float]
) -> None:
    assert speed_and_gap(tmp_path, distributions, options) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("distributions", "options", "says"),
    [
        (single("speed_kph", "50", "60"), "", r"2 variants of speed_kph; choose one with variants.xosc\?variant=1"),
        (single("speed_kph", "50", "60"), "?variant=3", "no variant 3: there are 1 to 2"),
        (single("speed_kph", "50", "60"), "?variant=0", "no variant 0"),
        (single("speed_kph", "50"), "?variant=-1", "expected a number from 1"),
        (single("speed_kph", "50"), "?speed_kmh=1", "no parameter 'speed_kmh' is declared; did you mean speed_kph"),
        (single("speed", "50"), "", "no parameter 'speed' is declared"),
        (single("speed_kph", "nan"), "", "not a number in range"),
        (single("speed_kph", "1e300"), "", "not a number in range"),
        (single("speed_kph"), "", "has no values"),
        (steps("speed_kph", "0", "30", "40"), "", "expected a positive stepWidth"),
        (steps("speed_kph", "1e-9", "30", "40"), "", "at most 10000 steps"),
        ("<Other/>", "", "Other is not a deterministic distribution"),
    ],
)
def test_what_leaves_a_choice_or_gives_none_is_told(
    tmp_path: Path, distributions: str, options: str, says: str
) -> None:
    with pytest.raises(ScenarioError, match=says):
        speed_and_gap(tmp_path, distributions, options)


def test_a_distribution_of_distributions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no Storyboard"):
        speed_and_gap(tmp_path, single("speed_kph", "50"), file="variants.xosc")


def test_a_scenario_has_no_variants_but_takes_values(tmp_path: Path) -> None:
    assert PARTS.load(tmp_path, "?speed_kph=18").ego.speed_mps[0.0] == pytest.approx(5.0)
    with pytest.raises(ScenarioError, match="it has no variants"):
        PARTS.load(tmp_path, "?variant=1")
