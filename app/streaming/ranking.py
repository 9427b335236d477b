"""Ranks the objects of a frame, best candidate for the CIPV first, each with the test that excluded it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from pipeline.types import FusedObject, Gate, Result

_OF_FUSION = frozenset({"iou", "range_sigmas", "class_size", "cluster_hits", "same_kind"})
"""Gates between the objects of two sensors: failing one splits a pair into two rows, but does not exclude either from
being the CIPV."""
BEHIND = "behind"
"""Reason for an object that passed every test: another one is nearer, or better known at the same place."""


@dataclass(frozen=True)
class Ranked:
    """One object and its rank."""

    id: int
    """Object number."""
    order: int
    """Starts at 1, the CIPV."""
    distance_m: float | None
    """None when unknown."""
    stopped_by: str | None
    """Name of the first failed gate, or ``BEHIND``; None for the CIPV."""
    value: float | None
    """The value tested by the gate; None when there was nothing to test."""
    limit: float | None
    """The gate's limit."""
    reason: str
    """In words."""


def ranking(result: Result) -> list[Ranked]:
    """The CIPV, then the other candidates by distance, then the objects that a gate excluded, by distance."""
    reasons = {each.id: each.reason for each in result.rejected}
    lead = result.cipv
    if lead is not None:
        reasons[lead.id] = lead.reason
    lead_id = lead.id if lead is not None else None
    gates = {item.id: stopping_gate(item) for item in result.objects}
    order = sorted(
        result.objects,
        key=lambda item: (
            item.id != lead_id,
            gates[item.id] is not None,
            item.distance_m is None,
            item.distance_m or 0.0,
            item.id,
        ),
    )
    return [
        Ranked(item.id, place, item.distance_m, *_stop(gates[item.id], item.id == lead_id), reasons.get(item.id, ""))
        for place, item in enumerate(order, 1)
    ]


def stopping_gate(item: FusedObject) -> Gate | None:
    """The first test that an object failed as a candidate; None when it passed all."""
    return next((gate for gate in item.gates if not gate.passed and gate.name not in _OF_FUSION), None)


def ranking_json(result: Result) -> list[dict[str, Any]]:
    """The ranking in the page's JSON format."""
    return [{name: _plain(value) for name, value in vars(each).items()} for each in ranking(result)]


def _stop(gate: Gate | None, leads: bool) -> tuple[str | None, float | None, float | None]:
    if leads:
        return None, None, None
    return (BEHIND, None, None) if gate is None else (gate.name, gate.value, gate.limit)


def _plain(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return round(value, 4) if math.isfinite(value) else None
