"""Scores as a report: figures, errors in the form of the paper's Table 4, what happened when, and the worst frames."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pipeline.evaluation.lead_verdict import LeadRule
from pipeline.evaluation.report_sections import Linked, ReportSection, Table
from pipeline.evaluation.scores import tracking
from pipeline.evaluation.scores.drive import DriveScore
from pipeline.evaluation.scores.error_tables import COLUMNS, SIGMA_COLUMNS, error_rows, errors_section, sigma_rows
from pipeline.evaluation.scores.figures import Compared, Drives, Interval, MeasuredFigure, compare, measure
from pipeline.evaluation.scores.matching import MAX_RANGE_M
from pipeline.evaluation.scores.worst import Bad, changed, worst

LinkTo = Callable[[str, int], str]
"""Returns the address that opens a recording's URI at a frame."""
FEW = 5
"""With fewer drives, bootstrap intervals are not meaningful: two drives have only three distinct samples."""
MOST = 20
"""Maximum rows of a list of frames."""


def sections(run: Drives, link: LinkTo, base: Drives | None = None) -> list[ReportSection]:
    """The report of a run over some drives; with ``base``, another run over the same drives, of the differences."""
    found = [_scores(run), errors_section(run), _moments(run, link), _worst(run, link)]
    return [_comparison(base, run, link), *found] if base is not None else found


def as_json(run: Drives, base: Drives | None = None) -> dict[str, Any]:
    """All metrics and rows of the error tables, for scripts."""
    out: dict[str, Any] = {
        "drives": [
            {
                "uri": drive.uri,
                "frames": len(drive.frames),
                "judged": sum(frame.judged is not None for frame in drive.frames),
                "judged_s": drive.judged_s,
                "clips": drive.clips,
                "notes": list(drive.notes),
                "worst": [_bad_json(bad) for bad in worst([drive], MOST)],
            }
            for drive in run
        ],
        "figures": {each.figure.name: _measured_json(each) for each in measure(run)},
        "errors": [dict(zip(COLUMNS, row, strict=True)) for row in error_rows(run)],
        "sigmas": [dict(zip(SIGMA_COLUMNS, row, strict=True)) for row in sigma_rows(run)],
        "cut_ins": [_cut_in_json(drive, n) for drive in run for n in range(len(drive.cut_ins))],
    }
    if base is not None:
        out["against"] = {each.figure.name: _compared_json(each) for each in compare(base, run)}
    return out


def _interval_json(interval: Interval | None) -> list[float] | None:
    return None if interval is None else [interval.low, interval.high]


def _measured_json(each: MeasuredFigure) -> dict[str, Any]:
    return {"value": each.value, "unit": each.figure.unit, "interval": _interval_json(each.interval)}


def _compared_json(each: Compared) -> dict[str, Any]:
    values = {"base": each.base, "run": each.run, "difference": each.difference}
    return {**values, "interval": _interval_json(each.interval), "unit": each.figure.unit}


def _bad_json(bad: Bad) -> dict[str, Any]:
    return {"frame": bad.name, "index": bad.index, "verdict": bad.verdict, "error_m": bad.error_m}


def _cut_in_json(drive: DriveScore, n: int) -> dict[str, Any]:
    cut_in = drive.cut_ins[n]
    return {"uri": drive.uri, "t_ns": cut_in.t_ns, "lead": cut_in.lead, "latency_s": cut_in.latency_s}


# ---------------------------------------------------------------- figures


def _scores(run: Drives) -> ReportSection:
    judged = sum(frame.judged is not None for drive in run for frame in drive.frames)
    seconds, rule = sum(drive.judged_s for drive in run), LeadRule()
    text = [
        f"{judged} frames with a known lead or known to have none, {seconds:.1f} s of {_many(len(run), 'drive')}. "
        "Missed: there is a lead, but no CIPV is chosen. Wrong: the CIPV is another vehicle, or the lead with its "
        f"distance off by more than {100 * rule.range_slack:.0f} % and {rule.range_slack_m:.0f} m. Errors are mean "
        "absolute errors of every labelled vehicle that an object matches.",
        f"Vehicles are scored up to {MAX_RANGE_M:.0f} m and 35° to either side. Two positions match within "
        f"{tracking.MATCH_M:.0f} m. A LiDAR object without a class makes no claim to be a vehicle: it counts only "
        "where there is one, so the LiDAR alone has no false detections. Detection and tracking are scored in frames "
        "whose vehicles are all labelled; an object there without a label counts as a false detection.",
    ]
    text += [
        f"{drive.uri}: {drive.clips} clips, each scored as a separate drive: nothing carries over between them."
        for drive in run
        if drive.clips > 1
    ]
    if len(run) < FEW:
        text.append(
            "Confidence intervals resample whole drives: a single drive has none, and those of fewer "
            f"than {FEW} are too narrow."
        )
    if not tracking.is_available():
        text.append(tracking.MISSING)
    text += [f"{drive.uri}: {note}" for drive in run for note in drive.notes]
    rows = tuple(
        (each.figure.title, each.figure.unit, each.value, *_ends(each.interval), _GOOD[each.figure.better])
        for each in measure(run)
    )
    columns = ("figure", "unit", "value", "95 % low", "high", "better")
    per_drive = tuple(
        (
            drive.uri,
            sum(frame.judged is not None for frame in drive.frames),
            *(figure.value for figure in measure([drive]) if figure.figure.name in _PER_DRIVE),
        )
        for drive in run
    )
    titles = tuple(each.figure.title for each in measure(run) if each.figure.name in _PER_DRIVE)
    tables = [Table("Figures", columns, rows)]
    if len(run) > 1:
        tables.append(Table("By drive", ("drive", "frames", *titles), per_drive))
    return ReportSection("scores", "Scores", tuple(text), tuple(tables))


_GOOD = {"higher": "more", "lower": "less"}
_PER_DRIVE = ("cipv_correct", "lead_missed", "cipv_false", "cipv_wrong", "lead_distance", "mota", "hota")


def _ends(interval: Interval | None) -> tuple[float | None, float | None]:
    return (None, None) if interval is None else (interval.low, interval.high)


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


# ---------------------------------------------------------------- events


def _moments(run: Drives, link: LinkTo) -> ReportSection:
    leads = tuple(
        (
            Linked(f"#{each.lead}", link(drive.uri, drive.index_of(each.t_ns))),
            drive.uri,
            "from the start" if each.from_start else "later",
            each.range_m,
            each.after_s,
            each.drop_outs,
        )
        for drive in run
        for each in drive.acquisitions
    )
    cut_ins = tuple(
        (Linked(f"#{each.lead}", link(drive.uri, drive.index_of(each.t_ns))), drive.uri, each.latency_s)
        for drive in run
        for each in drive.cut_ins
    )
    acts = tuple(
        (
            Linked(each.kind, link(drive.uri, drive.index_of(each.t_ns))),
            drive.uri,
            "no" if each.due_ns is None else "yes",
            "no" if each.acted_ns is None else "yes",
            each.delay_s,
            each.true_ttc_s,
        )
        for drive in run
        for each in drive.alarms
    )
    tables = (
        Table("Leads", ("lead", "drive", "led", "acquired at m", "after s", "drop-outs"), leads),
        Table("Cut-ins", ("vehicle", "drive", "latency s"), cut_ins),
        Table(
            "Warning and braking",
            ("stage", "drive", "due", "given", "delay s", "true TTC s"),
            acts,
            "Due: by the emergency brake's own limits, from the labelled lead's range and closing speed.",
        ),
    )
    return ReportSection("moments", "Timeline of events", (), tuple(table for table in tables if table.rows))


# ---------------------------------------------------------------- worst frames


def _worst(run: Drives, link: LinkTo) -> ReportSection:
    return ReportSection(
        "worst",
        "Worst frames",
        ("Links open the dashboard at the frame while `cipv serve` runs.",),
        (_frames("Wrong leads first, then the largest distance errors", worst(run, MOST), link),),
    )


def _frames(title: str, bad: Sequence[Bad], link: LinkTo) -> Table:
    rows = tuple(
        (
            Linked(each.name, link(each.uri, each.index)),
            each.uri,
            each.before,
            each.verdict,
            each.truth_m,
            each.distance_m,
            each.error_m,
        )
        for each in bad
    )
    columns = ("frame", "drive", "baseline", "verdict", "lead at m", "CIPV at m", "error m")
    if any(each.before for each in bad):
        return Table(title, columns, rows)
    return Table(title, (*columns[:2], *columns[3:]), tuple((*row[:2], *row[3:]) for row in rows))


def _comparison(base: Drives, run: Drives, link: LinkTo) -> ReportSection:
    rows = tuple(
        (
            each.figure.title,
            each.figure.unit,
            each.base,
            each.run,
            each.difference,
            *_ends(each.interval),
            _word(each, len(run)),
        )
        for each in compare(base, run)
    )
    columns = ("figure", "unit", "baseline", "run", "run − baseline", "95 % low", "high", "")
    return ReportSection(
        "comparison",
        "Compared with the baseline",
        (
            "The same frames, scored against the same ground truth. Better or worse is reported where the interval "
            f"excludes 0, from {FEW} drives on.",
        ),
        (
            Table("Run and baseline", columns, rows),
            _frames("Frames with a different verdict", changed(base, run, MOST), link),
        ),
    )


def _word(each: Compared, drives: int) -> str:
    """Better or worse, if there are enough drives and they agree."""
    if each.interval is None or drives < FEW or each.interval.low <= 0.0 <= each.interval.high:
        return ""
    return "better" if (each.interval.low > 0.0) == (each.figure.better == "higher") else "worse"
