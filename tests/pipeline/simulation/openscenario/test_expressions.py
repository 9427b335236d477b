"""Expressions are calculated as in the standard, and nothing else is."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.simulation.openscenario.expressions import evaluate

VALUES = {"speed_kph": "36", "_w": "1.8", "name": "abc"}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("10-4-3", 3.0),
        ("12/3/2", 2.0),
        ("7%4", 3.0),
        ("-7%4", -3.0),
        ("-2*-3", 6.0),
        ("--2", 2.0),
        ("1.5e1+.5", 15.5),
        ("$speed_kph/3.6", 10.0),
        (" $speed_kph * ( $_w / 2 ) ", 32.4),
        ("pi", math.pi),
        ("sign(-3)*max(1, 2)", -2.0),
        ("sign(0)", 0.0),
        ("min(1.0, 100.0-100)", 0.0),
        ("abs(round(-2.6))", 3.0),
        ("floor(2.9)+ceil(2.1)", 5.0),
        ("pow(sqrt(2), 2)", 2.0),
        ("sin(pi/2)+cos(0)", 2.0),
    ],
)
def test_arithmetic(text: str, value: float) -> None:
    assert evaluate(text, VALUES) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "cut off"),
        ("1+", "cut off"),
        ("(1", "cut off"),
        ("max(1)", "expected ','"),
        ("1 2", "unexpected '2'"),
        ("1)", "unexpected ')'"),
        ("$unknown", "no parameter 'unknown'"),
        ("$name", "parameter 'name' is not a number"),
        ("speed_kph", "unexpected 'speed_kph'"),
        ("1/0", "division by zero"),
        ("7%0", "division by zero"),
        ("sqrt(-1)", "sqrt is not defined"),
        ("acos(2)", "acos is not defined"),
        ("pow(10, 1000)", "too large"),
        ("1e308*10", "not a finite number"),
        ("__import__('os')", "unexpected"),
        ("open", "unexpected 'open'"),
        ("(" * 60 + "1" + ")" * 60, "nested too deeply"),
        ("-" * 60 + "1", "nested too deeply"),
        ("1+" * 2000 + "1", "longer than"),
        ("1;2", "unexpected ';'"),
    ],
)
def test_anything_else_is_refused(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says.replace("(", r"\(").replace(")", r"\)")):
        evaluate(text, VALUES)


@given(st.text("0123456789.eE+-*/%(),$ abspowminmaxsqrt_", max_size=40))
def test_any_text_is_a_number_or_refused(text: str) -> None:
    try:
        assert math.isfinite(evaluate(text, VALUES))
    except ValueError:
        return
