"""Arithmetic in attributes, such as ``${$Ego_speed_kph/3.6}``: numbers, names and a fixed set of functions.

ASAM OpenSCENARIO XML 1.3, "Expressions". The grammar is evaluated here, by recursive descent; nothing is handed to
Python.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_TOKEN = re.compile(rf"\s*(?:{_NUMBER}|\$?[A-Za-z_][A-Za-z0-9_]*|[-+*/%(),])")
_DEEPEST = 40
_LONGEST = 2000
"""Characters; Euro NCAP's longest has about 300."""
_CONSTANTS = {"pi": math.pi, "e": math.e}
_FUNCTIONS: dict[str, tuple[int, Callable[..., float]]] = {
    "abs": (1, abs),
    "acos": (1, math.acos),
    "asin": (1, math.asin),
    "atan": (1, math.atan),
    "ceil": (1, math.ceil),
    "cos": (1, math.cos),
    "floor": (1, math.floor),
    "max": (2, max),
    "min": (2, min),
    "pow": (2, math.pow),
    "round": (1, round),
    "sign": (1, lambda x: math.copysign(1.0, x) if x else 0.0),
    "sin": (1, math.sin),
    "sqrt": (1, math.sqrt),
    "tan": (1, math.tan),
}
"""Name → number of arguments, function."""


def evaluate(text: str, value_of: Mapping[str, str]) -> float:
    """The value of an expression without its ``${`` and ``}``. value_of: parameter name → value as text. ValueError
    says what is wrong."""
    if len(text) > _LONGEST:
        raise ValueError(f"the expression is longer than {_LONGEST} characters")
    reader = _ExpressionReader(_tokens(text), value_of)
    try:
        value = float(reader.whole())
    except OverflowError:
        raise ValueError("the result is too large") from None
    if not math.isfinite(value):
        raise ValueError("the result is not a finite number")
    return value


def _tokens(text: str) -> list[str]:
    found, at = [], 0
    stripped = text.rstrip()
    while at < len(stripped):
        match = _TOKEN.match(stripped, at)
        if match is None:
            raise ValueError(f"unexpected {stripped[at:].lstrip()[:1]!r}")
        found.append(match.group().strip())
        at = match.end()
    return found


class _ExpressionReader:
    """Reads the tokens of one expression from left to right."""

    def __init__(self, tokens: list[str], value_of: Mapping[str, str]) -> None:
        self._tokens, self._value_of = tokens, value_of
        self._at = self._depth = 0

    def whole(self) -> float:
        value = self._sum()
        if self._at < len(self._tokens):
            raise ValueError(f"unexpected {self._tokens[self._at]!r}")
        return value

    def _next(self) -> str:
        return self._tokens[self._at] if self._at < len(self._tokens) else ""

    def _take(self) -> str:
        token = self._next()
        if not token:
            raise ValueError("the expression is cut off")
        self._at += 1
        return token

    def _expect(self, wanted: str) -> None:
        token = self._take()
        if token != wanted:
            raise ValueError(f"expected {wanted!r} instead of {token!r}")

    def _sum(self) -> float:
        value = self._product()
        while self._next() in ("+", "-"):
            value = value + self._product() if self._take() == "+" else value - self._product()
        return value

    def _product(self) -> float:
        value = self._signed()
        while self._next() in ("*", "/", "%"):
            operator, right = self._take(), self._signed()
            if operator == "*":
                value *= right
            elif right == 0.0:
                raise ValueError("division by zero")
            else:
                value = value / right if operator == "/" else math.fmod(value, right)
        return value

    def _signed(self) -> float:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ValueError("the expression is nested too deeply")
        try:
            if self._next() in ("+", "-"):
                return self._signed() if self._take() == "+" else -self._signed()
            return self._operand()
        finally:
            self._depth -= 1

    def _operand(self) -> float:
        token = self._take()
        if token == "(":
            value = self._sum()
            self._expect(")")
            return value
        if token[0] == "$":
            return self._parameter(token[1:])
        if token[0].isdigit() or token[0] == ".":
            return float(token)
        if token in _FUNCTIONS:
            return self._call(token)
        if token in _CONSTANTS:
            return _CONSTANTS[token]
        raise ValueError(f"unexpected {token!r}")

    def _call(self, name: str) -> float:
        count, function = _FUNCTIONS[name]
        self._expect("(")
        values = [self._sum()]
        while len(values) < count:
            self._expect(",")
            values.append(self._sum())
        self._expect(")")
        try:
            return float(function(*values))
        except ValueError:
            raise ValueError(f"{name} is not defined for this value") from None

    def _parameter(self, name: str) -> float:
        if name not in self._value_of:
            raise ValueError(f"no parameter {name!r} is declared before it is used")
        try:
            return float(self._value_of[name])
        except ValueError:
            raise ValueError(f"parameter {name!r} is not a number") from None
