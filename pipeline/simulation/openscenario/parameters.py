"""Parameters of a file, and the values of attributes that refer to them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from pipeline.common.files.user_file_errors import did_you_mean
from pipeline.simulation.openscenario.expressions import evaluate
from pipeline.simulation.openscenario.xml_files import XmlElement, number_in, shown

_NUMERIC = {"double", "integer", "int", "unsignedInt", "unsignedShort"}
RULES: dict[str, Callable[[float, float], bool]] = {
    "equalTo": lambda a, b: a == b,
    "greaterThan": lambda a, b: a > b,
    "lessThan": lambda a, b: a < b,
    "greaterOrEqual": lambda a, b: a >= b,
    "lessOrEqual": lambda a, b: a <= b,
    "notEqualTo": lambda a, b: a != b,
}
"""Comparisons of ASAM OpenSCENARIO's ``Rule``."""


class ParameterScope:
    """The parameters that are visible in a part of a file."""

    def __init__(self, values: Mapping[str, str] | None = None) -> None:
        self.values: dict[str, str] = dict(values or {})

    def declare(self, at: XmlElement, given: Mapping[str, str]) -> None:
        """Add the parameters that ``at`` declares; ``given`` replaces their default values. Every given name must be
        declared."""
        declarations = at.find("ParameterDeclarations")
        known = []
        for each in declarations.all("ParameterDeclaration") if declarations is not None else []:
            name = self.text(each, "name")
            known.append(name)
            value = given[name] if name in given else self.text(each, "value")
            if each.attributes.get("parameterType") in _NUMERIC:
                number_in(value, each, f"{shown(name)}, value")
            self.values[name] = value
            self._check_limits(each, name)
        for name in given:
            if name not in known:
                raise at.refusal(f"no parameter {shown(name)!r} is declared{did_you_mean(name, known)}")

    def _check_limits(self, at: XmlElement, name: str) -> None:
        """At least one group of constraints must hold entirely."""
        groups = at.all("ConstraintGroup")
        for group in groups:
            if all(
                compare(self.values[name], self.text(limit, "rule"), self.text(limit, "value"), limit)
                for limit in group.all("ValueConstraint")
            ):
                return
        if groups:
            raise at.refusal(f"parameter {shown(name)} = {shown(self.values[name])} violates its constraints")

    def text(self, at: XmlElement, name: str, otherwise: str | None = None) -> str:
        """The value of an attribute: as written, a parameter's (``$name``), or calculated (``${…}``)."""
        raw = at.attributes.get(name, otherwise)
        if raw is None:
            raise at.refusal(f"{at.tag} has no {name}")
        if not raw.startswith("$"):
            return raw
        if raw.startswith("${"):
            if not raw.endswith("}"):
                raise at.refusal(f"{name}={shown(raw)!r} has no closing brace")
            try:
                return repr(evaluate(raw[2:-1], self.values))
            except ValueError as error:
                raise at.refusal(f"{name}={shown(raw)!r}: {shown(str(error))}") from None
        if raw[1:] not in self.values:
            raise at.refusal(f"no parameter {shown(raw[1:])!r} is declared{did_you_mean(raw[1:], self.values)}")
        return self.values[raw[1:]]

    def number(self, at: XmlElement, name: str, otherwise: float | None = None) -> float:
        """A finite number."""
        return number_in(self.text(at, name, None if otherwise is None else repr(otherwise)), at, name)

    def integer(self, at: XmlElement, name: str) -> int:
        """A whole number, such as a lane's."""
        value = self.number(at, name)
        if value != round(value):
            raise at.refusal(f"{at.tag} {name}={value:g} is not a whole number")
        return round(value)

    def truth(self, at: XmlElement, name: str, otherwise: bool) -> bool:
        """A boolean: true, false, 1 or 0."""
        value = self.text(at, name, str(otherwise).lower())
        if value not in ("true", "false", "1", "0"):
            raise at.refusal(f"{at.tag} {name}={shown(value)!r} is neither true nor false")
        return value in ("true", "1")


def compare(left: str, rule: str, right: str, at: XmlElement) -> bool:
    """Two values by a rule: as numbers if both are, else only whether they are equal."""
    if rule not in RULES:
        raise at.refusal(f"unknown rule {shown(rule)!r}")
    try:
        return RULES[rule](float(left), float(right))
    except ValueError:
        if rule not in ("equalTo", "notEqualTo"):
            raise at.refusal(f"{shown(left)!r} and {shown(right)!r} have no order") from None
        return (left == right) == (rule == "equalTo")
