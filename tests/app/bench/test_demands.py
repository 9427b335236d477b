"""Requirements on the stages: one that is missed or was not measured is reported."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from app.bench.demands import DEMANDS, PAGE_DEMANDS, Requirement, broken, page_rows


def figures(demands: tuple[Requirement, ...] = DEMANDS) -> dict[str, dict[str, Any]]:
    """Each figure exactly at its requirement."""
    made: dict[str, dict[str, Any]] = {}
    for demand in demands:
        row = made.setdefault(demand.stage, {"peers": {}})
        if demand.peer is not None:
            row = row["peers"].setdefault(demand.peer, {})
        row[demand.figure] = demand.at_most if demand.at_most is not None else demand.at_least
    return made


def test_what_is_as_fast_as_demanded_holds() -> None:
    assert list(broken(figures())) == []


@pytest.mark.parametrize("demand", DEMANDS, ids=lambda demand: f"{demand.stage} {demand.peer or demand.figure}")
def test_what_is_slower_is_said(demand: Any) -> None:
    slower = copy.deepcopy(figures())
    row = slower[demand.stage] if demand.peer is None else slower[demand.stage]["peers"][demand.peer]
    row[demand.figure] *= 1.01 if demand.at_most is not None else 0.99
    (sentence,) = broken(slower)
    assert sentence.startswith(f"{demand.stage}: {demand.figure}")
    assert "required: at" in sentence


def test_the_page_is_judged_by_its_own_demands_also_while_a_drive_is_computed() -> None:
    good = figures(PAGE_DEMANDS)
    page = {what.replace(" ", "_"): good[what] for what in ("seek", "first view")}
    computed = {what: copy.deepcopy(row) for what, row in page.items()}
    measured = {"page": page, "while_computed": computed}
    assert list(broken(page_rows(measured), PAGE_DEMANDS)) == []
    computed["seek"]["median_ms"] += 1.0
    (sentence,) = broken(page_rows(measured), PAGE_DEMANDS)
    assert sentence == "seek while computed: median_ms is 151.00; required: at most 150"


def test_what_was_not_measured_is_said_but_for_absent_peers_and_recordings() -> None:
    less = figures()
    del less["step"]["median_ms"]
    less["cluster"]["peers"]["open3d cluster_dbscan"] = {"ratio": None, "absent": "not installed"}
    del less["ground@kitti"]
    assert list(broken(less)) == ["step: median_ms was not measured"]
