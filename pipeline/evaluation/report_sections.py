"""Reports as plain values: text, tables and charts, for a page or a script to show."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

from pipeline.simulation.scenario import Scenario

Tone = Literal["green", "yellow", "orange", "brown", "red", "grey"]
Cell = str | float | int | None


@dataclass(frozen=True)
class Coloured:
    """A cell whose colour has the meaning that the table's caption gives. drive: name of the drive it comes from, where
    one is kept."""

    value: Cell
    tone: Tone
    drive: str = ""


@dataclass(frozen=True)
class Driven:
    """A cell with the name of the drive it comes from."""

    value: Cell
    drive: str


@dataclass(frozen=True)
class Linked:
    """A cell with a link; href is an absolute address."""

    value: Cell
    href: str


AnyCell = Cell | Coloured | Driven | Linked


@dataclass(frozen=True)
class Table:
    """Numbers keep their full precision here; None is shown as a dash. decimals: for people."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[AnyCell, ...], ...]
    caption: str = ""
    decimals: int = 2


@dataclass(frozen=True)
class Series:
    """One line (or its points) of a chart."""

    name: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    points_only: bool = False

    @staticmethod
    def of_points(name: str, points: Iterable[tuple[float, float]]) -> Series:
        """Points without a connecting line, each x and y."""
        found = list(points)
        return Series(name, tuple(x for x, _ in found), tuple(y for _, y in found), points_only=True)


@dataclass(frozen=True)
class Chart:
    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]


@dataclass(frozen=True)
class Scene:
    """A moment of a scenario, to be drawn."""

    title: str
    scenario: Scenario
    t_s: float


@dataclass(frozen=True)
class Section:
    """One experiment's report. text: paragraphs on what was done and what it shows. failures: a sentence for each
    requirement that is not met. scenes: the scenes that were driven."""

    name: str
    title: str
    text: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    charts: tuple[Chart, ...] = ()
    failures: tuple[str, ...] = ()
    scenes: tuple[Scene, ...] = ()


def as_json(section: Section) -> dict[str, Any]:
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
