"""Generates the page on a fleet's tables from their declaration."""

from __future__ import annotations

from collections.abc import Iterator

from app.drive.events import event_kinds
from app.fleet.batch.tables import TABLES
from app.fleet.find import NAMED


def tables_page(made: str) -> str:
    """Every table of a batch with its columns."""
    return "\n".join(_tables_lines(made)) + "\n"


def _tables_lines(made: str) -> Iterator[str]:
    yield from (
        "# Tables of a fleet",
        "",
        made,
        "",
        "`cipv batch` writes these tables as Parquet, and `cipv find` searches them. See",
        "[Run a fleet](../guides/fleet.md).",
        "",
        "| file | contains |",
        "|---|---|",
        "| `tables/TABLE/run=RUN/drive=DRIVE/part.parquet` | the rows of one drive |",
        "| `packed/TABLE/run=RUN/NUMBER.parquet` | the same rows of a few hundred drives, with a column `drive` |",
        "| `done/run=RUN/DRIVE.MARK.json` | marks that all files of a drive are complete |",
        "| `aside/run=RUN/DRIVE.MARK.json` | the reason why a recording was set aside |",
        "| `runs/RUN.json` | the code, networks and parameters of a run |",
        "| `boxes/MARK/…` | the networks' detections in a recording's images |",
        "| `results/run=RUN/DRIVE.jsonl.zst` | with `--results`: the JSON lines of `cipv run`, without timings |",
        "",
        "A missing value is null. The same recordings, code, parameters and networks give the same bytes in every file",
        "except those of `timings`, whatever the number of workers.",
    )
    for table in TABLES:
        yield from (
            "",
            f"## {table.name}",
            "",
            table.about,
            "",
            "| column | type | unit | meaning |",
            "|---|---|---|---|",
        )
        for column in table.columns:
            yield f"| `{column.name}` | {column.kind} | {column.unit} | {_in_cell(column.about)} |"
    yield from (
        "",
        "## In queries",
        "",
        "`cipv find` adds to every table but `drives` the drive's `address`, `title`, `brightness`, `mean_speed_mps`",
        "and `mean_bend_radpm`, and `t_s`. In `events` each kind of event is a column that is true for it:",
        ", ".join(f"`{kind}`" for kind in event_kinds()) + ".",
        "There are also named conditions:",
        "",
        "| name | stands for |",
        "|---|---|",
        *(f"| `{name}` | `{_in_cell(sql)}` |" for name, sql in NAMED.items()),
    )


def _in_cell(text: str) -> str:
    return text.replace("|", "\\|")
