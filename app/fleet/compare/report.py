"""The comparison of two runs as a report: tables for a page, a terminal or a script."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from app.fleet.compare.changes import EventChange, LeadChange, changed_drives, changed_events
from app.fleet.compare.paired import CONDITIONS, FEW, PairedScore, paired
from app.fleet.find import FleetTables
from app.fleet.runs import about_run, differences
from pipeline.common.errors import BadInput
from pipeline.evaluation.report_sections import Linked, ReportSection, Table

FrameUrl = Callable[[str, int], str]
"""From the address of a recording and a frame to the address that opens it."""


@dataclass(frozen=True)
class FleetComparison:
    """Two runs over the drives that both have."""

    base: str
    """Name of the run that is compared with."""
    run: str
    """Name of the run that is judged."""
    differences: tuple[str, ...]
    """Parameters, code and networks that the runs differ in."""
    drives: int
    """That both have."""
    scores: tuple[PairedScore, ...]
    """Every score that both have, over all of these drives."""
    by_condition: dict[str, tuple[PairedScore, ...]]
    """Scores that surely changed, in parts of the drives."""
    events: tuple[EventChange, ...]
    """One per kind that either run has, by name."""
    changes: tuple[LeadChange, ...]
    """The worst ones."""
    differing: int
    """Frames with another lead."""
    frames: int
    """That both have."""


def compare_runs(base: FleetTables, run: FleetTables, most: int = 20) -> FleetComparison:
    """Compare two runs. most: how many changes to list. Raises BadInput if they have no drive in common."""
    rows = {str(row["drive"]): row for row in base.rows("drives")}
    shared = sorted(rows.keys() & set(run.drives()))
    if not shared:
        raise BadInput(f"runs {base.run} and {run.run} have no drive in common")
    ours, theirs = base.scores(), run.scores()
    by_condition = {}
    for condition in CONDITIONS:
        inside = [drive for drive in shared if condition.holds(rows[drive])]
        changed = tuple(each for each in paired(ours, theirs, inside) if each.verdict)
        if changed:
            by_condition[f"{condition.name} ({len(inside)} drives)"] = changed
    changes, differing, frames = changed_drives(base, run, most)
    return FleetComparison(
        base.run,
        run.run,
        tuple(differences(about_run(base.store, base.run), about_run(run.store, run.run))),
        len(shared),
        tuple(paired(ours, theirs, shared)),
        by_condition,
        tuple(changed_events(base, run)),
        tuple(changes),
        differing,
        frames,
    )


def sections(told: FleetComparison, link: FrameUrl) -> list[ReportSection]:
    """For people."""
    text = (
        f"Differences: {', '.join(told.differences) or 'none'}.",
        f"{told.drives} drives are in both runs. The lead differs in {told.differing} of {told.frames} frames.",
        "Intervals resample whole drives in pairs. Better or worse is reported where the interval excludes 0, from "
        f"{FEW} drives on.",
    )
    columns = ("score", "unit", "base", "run", "run − base", "95 % low", "high", "drives", "better in", "worse in", "")
    tables = [Table("Scores", columns, tuple(map(_row, told.scores)), decimals=3)]
    apart = tuple((name, *_row(score)) for name, scores in told.by_condition.items() for score in scores)
    if apart:
        tables.append(Table("Significant changes by condition", ("condition", *columns), apart, decimals=3))
    events = tuple((each.kind, each.base, each.run, each.lost, each.gained) for each in told.events)
    tables.append(Table("Events", ("kind", "base", "run", "only in the base", "only in the run"), events))
    changes = tuple(
        (Linked(each.drive, link(each.address, each.index)), each.index, each.frames, each.longest, each.text)
        for each in told.changes
    )
    heads = ("drive", "frame", "frames with a different lead", "longest in a row", "there")
    return [
        ReportSection("comparison", f"Run {told.run} compared with {told.base}", text, tuple(tables)),
        ReportSection(
            "changes",
            "Largest changes",
            ("Links open the dashboard at the first frame of the longest stretch, while `cipv serve` runs.",),
            (Table("Different lead", heads, changes),),
        ),
    ]


def as_json(told: FleetComparison, link: FrameUrl) -> dict[str, Any]:
    """For scripts."""
    return {
        "base": told.base,
        "run": told.run,
        "differences": list(told.differences),
        "drives": told.drives,
        "frames": told.frames,
        "frames_with_another_lead": told.differing,
        "scores": {each.info.name: _score_json(each) for each in told.scores},
        "by_condition": {
            name: {each.info.name: _score_json(each) for each in scores} for name, scores in told.by_condition.items()
        },
        "events": {
            each.kind: {"base": each.base, "run": each.run, "lost": each.lost, "gained": each.gained}
            for each in told.events
        },
        "changes": [
            {
                "drive": each.drive,
                "address": each.address,
                "index": each.index,
                "frames": each.frames,
                "longest": each.longest,
                "text": each.text,
                "link": link(each.address, each.index),
            }
            for each in told.changes
        ],
    }


def _row(each: PairedScore) -> tuple[Any, ...]:
    low, high = (None, None) if each.interval is None else (each.interval.low, each.interval.high)
    counts = (each.drives, each.improved, each.worsened)
    return (each.info.title, each.info.unit, each.base, each.run, each.difference, low, high, *counts, each.verdict)


def _score_json(each: PairedScore) -> dict[str, Any]:
    interval = None if each.interval is None else [each.interval.low, each.interval.high]
    values = {"base": each.base, "run": each.run, "difference": each.difference, "interval": interval}
    counts = {"drives": each.drives, "improved": each.improved, "worsened": each.worsened}
    return {**values, "unit": each.info.unit, **counts, "verdict": each.verdict}
