"""Reports as plain values (text, tables and charts) that a page or a script can show."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from pipeline.simulation.scenario import Scenario

Tone = Literal["green", "yellow", "orange", "brown", "red", "grey"]
Cell = str | float | int | None


@dataclass(frozen=True)
class Coloured:
    """A cell with a colour, whose meaning is given in the table's caption."""

    value: Cell
    """As for a cell without colour."""
    tone: Tone
    """One of the report's colours."""
    drive: str = ""
    """Name of its saved drive; empty without one."""


@dataclass(frozen=True)
class Driven:
    """A cell with the name of its drive."""

    value: Cell
    """As without a drive."""
    drive: str
    """Name under which the drive is saved."""


@dataclass(frozen=True)
class Linked:
    """A cell with a link; href is an absolute address."""

    value: Cell
    """Text of the link."""
    href: str
    """An absolute address."""


AnyCell = Cell | Coloured | Driven | Linked


@dataclass(frozen=True)
class Table:
    """Numbers have full precision here; None is shown as a dash. decimals: for display."""

    title: str
    """Above the table."""
    columns: tuple[str, ...]
    """Headings; every row has as many cells."""
    rows: tuple[tuple[AnyCell, ...], ...]
    """Numbers with their full precision; None is shown as a dash."""
    caption: str = ""
    """What the table shows and how to read it; empty for none."""
    decimals: int = 2
    """Number of decimals shown."""


@dataclass(frozen=True)
class Series:
    """One line (or its points) of a chart."""

    name: str
    """In the legend."""
    x: tuple[float, ...]
    """Values along the chart's x axis."""
    y: tuple[float, ...]
    """As long as ``x``."""
    points_only: bool = False
    """Dots without a line."""

    @staticmethod
    def of_points(name: str, points: Iterable[tuple[float, float]]) -> Series:
        """Points without a connecting line, each x and y."""
        found = list(points)
        return Series(name, tuple(x for x, _ in found), tuple(y for _, y in found), points_only=True)


@dataclass(frozen=True)
class Chart:
    """Lines over one pair of axes."""

    title: str
    """Above the chart."""
    x_label: str
    """With its unit."""
    y_label: str
    """With its unit."""
    series: tuple[Series, ...]
    """In the order of the legend."""


@dataclass(frozen=True)
class Scene:
    """A moment of a scenario, to be rendered."""

    title: str
    """Below the drawing."""
    scenario: Scenario
    """What is drawn."""
    t_s: float
    """Time in the scenario."""


@dataclass(frozen=True)
class ReportSection:
    """One experiment's report."""

    name: str
    """For scripts and links."""
    title: str
    """For people."""
    text: tuple[str, ...] = ()
    """Paragraphs on what was done and what it shows."""
    tables: tuple[Table, ...] = ()
    """In order, below the text."""
    charts: tuple[Chart, ...] = ()
    """In order, below the tables."""
    failures: tuple[str, ...] = ()
    """A sentence for each requirement that is not met."""
    scenes: tuple[Scene, ...] = ()
    """The scenes that were driven."""


def as_json(section: ReportSection) -> dict[str, Any]:
    """The section as plain dicts, lists, strings and numbers."""
    return {
        "name": section.name,
        "title": section.title,
        "text": list(section.text),
        "tables": [
            {
                "title": table.title,
                "columns": list(table.columns),
                "rows": [[_plain(cell) for cell in row] for row in table.rows],
                "caption": table.caption,
            }
            for table in section.tables
        ],
        "charts": [
            {
                "title": chart.title,
                "x": chart.x_label,
                "y": chart.y_label,
                "series": [{"name": line.name, "x": list(line.x), "y": list(line.y)} for line in chart.series],
            }
            for chart in section.charts
        ],
        "failures": list(section.failures),
    }


def _plain(cell: AnyCell) -> Any:
    if isinstance(cell, Linked):
        return {"value": cell.value, "href": cell.href}
    if isinstance(cell, Driven):
        return cell.value
    return {"value": cell.value, "tone": cell.tone} if isinstance(cell, Coloured) else cell
