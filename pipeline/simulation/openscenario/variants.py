"""Files that list values of a scenario's parameters (``ParameterValueDistribution``): one value each makes a scenario,
several make variants to choose from."""

from __future__ import annotations

from collections.abc import Mapping
from math import floor, prod

from pipeline.simulation.openscenario.parameters import ParameterScope
from pipeline.simulation.openscenario.xml_files import OpenScenarioError, XmlElement, shown

_MOST_STEPS = 10_000
_ONE_STEP = 1e-9  # of a step: 0.1 + 0.1 + 0.1 still reaches 0.3

_Axis = list[dict[str, str]]
"""Alternatives, each a set of parameter values."""


class Variants:
    """All combinations of the values in a file."""

    def __init__(self, distribution: XmlElement, given: Mapping[str, str]) -> None:
        """given: values that the user set, which take the place of those in the file."""
        if distribution.find("Stochastic") is not None:
            raise distribution.refusal("Stochastic is not supported; only Deterministic distributions are")
        axes = [_axis(each) for each in distribution.one("Deterministic").children]
        self._axes = [axis for axis in axes if not all(name in given for values in axis for name in values)]
        self._file, self._given = distribution.file, given
        self._count = prod(len(axis) for axis in self._axes)

    def values(self, variant: int) -> dict[str, str]:
        """The parameter values of one variant, from 1; the last distribution of the file varies fastest."""
        if not 1 <= variant <= self._count:
            raise OpenScenarioError(f"{self._file}: no variant {variant}: there are 1 to {self._count}")
        left, chosen = variant - 1, dict[str, str]()
        for axis in reversed(self._axes):
            left, index = divmod(left, len(axis))
            chosen = {**axis[index], **chosen}
        return {**chosen, **self._given}

    def check_single(self) -> None:
        """OpenScenarioError if there are several to choose from."""
        if self._count == 1:
            return
        names = sorted({name for axis in self._axes if len(axis) > 1 for values in axis for name in values})
        raise OpenScenarioError(
            f"{self._file}: {self._count} variants of {', '.join(map(shown, names[:6]))}; choose one with "
            f"{self._file}?variant=1 (1 to {self._count}), or set parameters with ?NAME=VALUE&NAME=VALUE"
        )


def _axis(at: XmlElement) -> _Axis:
    scope = ParameterScope()
    if at.tag == "DeterministicSingleParameterDistribution":
        name, how = scope.text(at, "parameterName"), at.only()
        if how.tag == "DistributionSet":
            axis = [{name: scope.text(each, "value")} for each in how.all("Element")]
        elif how.tag == "DistributionRange":
            axis = [{name: value} for value in _steps(how)]
        else:
            raise how.refusal(f"{how.tag} is not supported; DistributionSet and DistributionRange are")
    elif at.tag == "DeterministicMultiParameterDistribution":
        axis = [
            {scope.text(one, "parameterRef"): scope.text(one, "value") for one in each.all("ParameterAssignment")}
            for each in at.one("ValueSetDistribution").all("ParameterValueSet")
        ]
    else:
        raise at.refusal(f"{at.tag} is not a deterministic distribution")
    if not axis:
        raise at.refusal(f"{at.tag} has no values")
    return axis


def _steps(at: XmlElement) -> list[str]:
    scope, ends = ParameterScope(), at.one("Range")
    step, low, high = scope.number(at, "stepWidth"), scope.number(ends, "lowerLimit"), scope.number(ends, "upperLimit")
    if step <= 0.0 or high < low or (high - low) / step > _MOST_STEPS:
        raise at.refusal(f"expected a positive stepWidth, ascending limits and at most {_MOST_STEPS} steps")
    return [repr(low + i * step) for i in range(floor((high - low) / step + _ONE_STEP) + 1)]
