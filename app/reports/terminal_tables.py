"""Reports as tables in a terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.table import Table as RichTable

from app.reports.html import in_words
from pipeline.evaluation.report_sections import Coloured, Driven, Linked, ReportSection

_FILE_WIDTH = 160
"""Width in characters of a table that is written to a file or a pipe."""


def show(sections: Iterable[ReportSection]) -> None:
    """Print the tables of the sections. Charts are only in the HTML report."""
    console = Console(width=None if Console().is_terminal else _FILE_WIDTH)
    for section in sections:
        console.rule(section.title)
        for paragraph in section.text:
            console.print(paragraph)
        for table in section.tables:
            shown = RichTable(*table.columns, title=table.title, caption=table.caption or None)
            for row in table.rows:
                values = (cell.value if isinstance(cell, Coloured | Driven | Linked) else cell for cell in row)
                shown.add_row(*(in_words(value, table.decimals) for value in values))
            console.print(shown)
