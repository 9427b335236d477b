"""Parameters: order of declaration, types, constraints and booleans."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.simulation.scenario import ScenarioError
from tests.pipeline.simulation.openscenario.files import (
    Parts,
    by_value,
    condition,
    declared,
    event,
    init,
    on_lane,
    speed_action,
    story,
)

AT_LEAST_4 = '<ConstraintGroup><ValueConstraint rule="greaterThan" value="4"/></ConstraintGroup>'


def with_speed(parameters: str, speed: str) -> Parts:
    return Parts(
        parameters=parameters, init=init("Ego", on_lane(-1, 100.0), speed) + init("Lead", on_lane(-1, 150.0), "20")
    )


@pytest.mark.parametrize(
    ("parameters", "speed", "expected"),
    [
        (declared("v", "12"), "$v", 12.0),
        (declared("v", "12") + declared("w", "${$v/2}"), "$w", 6.0),
        (declared("v", "12") + declared("w", "$v"), "${$w+1}", 13.0),
        (declared("v", "5", inside=AT_LEAST_4), "$v", 5.0),
    ],
)
def test_values(tmp_path: Path, parameters: str, speed: str, expected: float) -> None:
    assert with_speed(parameters, speed).load(tmp_path).ego.speed_mps == {0.0: expected}


@pytest.mark.parametrize(
    ("parameters", "speed", "says"),
    [
        ("", "$v", "no parameter 'v' is declared"),
        (declared("speed", "1"), "$sped", "did you mean speed?"),
        (declared("w", "${$v}") + declared("v", "1"), "$w", "declared before it is used"),
        (declared("v", "${$v+1}"), "$v", "declared before it is used"),
        (declared("v", "fast"), "$v", "'fast' is not a number in range"),
        (declared("v", "3", inside=AT_LEAST_4), "$v", "parameter v = 3 violates its constraints"),
        (declared("v", "x", "string"), "$v", "is not a number in range"),
        ("", "${1+}", "the expression is cut off"),
        ("", "${1", "has no closing brace"),
        ("", "NaN", "is not a number in range"),
        ("", "1e12", "is not a number in range"),
        ("", "101", "the simulator drives forward, up to 100 m/s"),
        ("", "-5", "the simulator drives forward"),
    ],
)
def test_errors(tmp_path: Path, parameters: str, speed: str, says: str) -> None:
    with pytest.raises(ScenarioError) as error:
        with_speed(parameters, speed).load(tmp_path)
    assert says in str(error.value)
    assert str(error.value).startswith("drive.xosc, line 1: ")


@pytest.mark.parametrize(("given", "brakes"), [("?braking=true", True), ("", False)])
def test_a_parameter_switches_an_act(tmp_path: Path, given: str, brakes: bool) -> None:
    switch = condition(by_value('<ParameterCondition parameterRef="braking" rule="equalTo" value="true"/>'))
    parts = Parts(
        parameters=declared("braking", "false", "boolean"),
        stories=story(event("e", speed_action("0")), of_act=f"<StartTrigger>{switch}</StartTrigger>"),
    )
    assert (parts.load(tmp_path, given).actors[0].speed_mps == {0.0: 0.0}) == brakes
