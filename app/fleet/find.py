"""Queries on a batch's tables, in SQL, run by DuckDB: which moments, frames, objects or drives meet a condition. A
query can read the batch's folder and nothing else."""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import duckdb

from app.drive.events import event_kinds
from app.fleet.batch.tables import EQUAL_TABLES, ColumnType, TableShape
from app.fleet.pack_index import packed_file, packs_of
from app.fleet.query_result import QueryResult, QueryTable
from app.fleet.runs import check_run, latest_run
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import did_you_mean

Answer = TypeVar("Answer")
_ALWAYS = ("drive", "address", "index", "t_s")
_SHOWN: dict[QueryTable, tuple[str, ...]] = {
    "events": ("kind", "text", "distance_m", "ttc_s", "min_ttc_s", "max_gap_sigmas", "speed_mps"),
    "frames": ("cipv_id", "source", "distance_m", "closing_speed_mps", "ttc_s", "vl_gap_sigmas", "speed_mps"),
    "objects": ("id", "source", "type", "distance_m", "closing_speed_mps", "ttc_s", "in_path", "vl_gap_sigmas"),
    "drives": ("title", "frames", "duration_s", "mean_speed_mps", "frames_with_lead"),
}
_ORDER: dict[QueryTable, tuple[str, ...]] = {
    "events": ("drive", "index", "kind", "id"),
    "frames": ("drive", "index"),
    "objects": ("drive", "index", "distance_m", "id"),
    "drives": ("drive",),
}
"""Columns that no two rows share, so that the same question has the same answer each time."""
NAMED = {
    "disagreement": "max_gap_sigmas > 3",
    "close": "min_ttc_s < 1.5",
    "night": "brightness < 60",
    "bend": "speed_mps > 3 AND abs(yaw_rate_radps) > 0.004 * speed_mps",
}
"""Conditions by name, beside the kinds of event: usable in events like a column."""


_TYPES: dict[ColumnType, str] = {
    "bool": "BOOLEAN",
    "int32": "INTEGER",
    "int64": "BIGINT",
    "float32": "FLOAT",
    "float64": "DOUBLE",
    "string": "VARCHAR",
}
"""DuckDB's names of the tables' types."""
_BEHIND_CONDITION = re.compile(r"syntax error at .*\n+LINE \d+: \)")
"""DuckDB's message if the error is in what follows the typed condition, on a line of its own."""
_UNKNOWN_COLUMN = re.compile(r'Referenced column "(.*)" not found')

MOST_BYTES = 2 << 30
"""Memory that questions with a time limit may take; the usual ones on 10,000 drives take a tenth."""


class FleetTables:
    """The tables of one run, open for queries. For one thread.

    Args:
        store: the batch's folder.
        run: name of the run; None: the last batch's.
        most_s: a question that takes longer is stopped; None for no limit.

    Raises:
        BadInput: there is no such run, or a file of its tables is missing or damaged.
    """

    def __init__(self, store: Store, run: str | None = None, most_s: float | None = None) -> None:
        self.store, self.run, self._most_s = store, run or latest_run(store), most_s
        check_run(store, self.run)
        self._numbers = [each.number for each in packs_of(store, self.run)]
        if not self._numbers:
            raise BadInput(f"{store.address}: run {self.run} has no drives yet")
        self._duckdb = duckdb.connect()
        self._shut_in()
        for shape in EQUAL_TABLES:
            try:
                self._make_view(shape)
            except duckdb.Error as error:
                raise BadInput(
                    f"{store.address}: table {shape.name} of run {self.run} cannot be read: {_first_line(error)}; "
                    f"`cipv batch` packs it again once packed/run={self.run}.json is removed"
                ) from None

    def find(
        self,
        where: str,
        of: QueryTable = "events",
        limit: int = 100,
        columns: Sequence[str] = (),
        order: str = "",
        descending: bool = False,
    ) -> QueryResult:
        """The rows that meet a condition, by drive and time, objects nearest first.

        Args:
            where: an SQL condition over the columns of docs/reference/fleet-tables.md, names of events and ``NAMED``.
            of: which table.
            limit: most rows returned.
            columns: shown beside drive, address and time; default: the usual ones.

        Raises:
            BadInput: the condition is invalid or names an unknown column.
        """
        shown = [name for name in _ALWAYS if of != "drives" or name in ("drive", "address")]
        shown += columns or _SHOWN[of]
        names = ", ".join(_quoted(name) for name in shown)
        condition = where.strip() or "true"
        first = [f"{_quoted(order)} {'DESC' if descending else 'ASC'} NULLS LAST"] if order else []
        ordered = ", ".join([*first, *map(_quoted, _ORDER[of])])
        # on a line of its own, so that a comment ends with it
        fulfilled = f"FROM {of} WHERE (\n{condition}\n)"
        counted = f"SELECT {names}, count(*) OVER () AS found {fulfilled}"
        rows = self._ask(f"{counted} ORDER BY {ordered} LIMIT {limit}", of)
        total = int(rows[0][-1]) if rows else 0
        return QueryResult(tuple(shown), tuple(tuple(map(_plain, row[:-1])) for row in rows), total)

    def scores(self) -> list[tuple[str, str, float, float]]:
        """(drive, score, over, under) of every drive."""
        rows = self._rows('SELECT drive, score, "over", under FROM scores ORDER BY ALL')
        return [(str(drive), str(score), float(over), float(under)) for drive, score, over, under in rows]

    def drives(self) -> list[str]:
        """Names of all drives."""
        return [str(row[0]) for row in self._rows("SELECT drive FROM drives ORDER BY drive")]

    def rows(self, table: QueryTable) -> list[dict[str, Any]]:
        """Every row of a table, by column."""

        def asked() -> list[dict[str, Any]]:
            found = self._duckdb.execute(f"SELECT * FROM {table} ORDER BY ALL")
            names = [column[0] for column in found.description or ()]
            return [dict(zip(names, row, strict=True)) for row in found.fetchall()]

        return self._interruptibly(asked)

    def ask(self, sql: str) -> Any:
        """The result of a complete query, which must not come from outside, as a pyarrow table."""
        return self._interruptibly(lambda: self._duckdb.sql(sql).to_arrow_table())

    def arrow(self, table: QueryTable, columns: str) -> Any:
        """Columns of a table, named in SQL, as a pyarrow table."""
        return self.ask(f"SELECT {columns} FROM {table}")

    def histogram(self, where: str, of: QueryTable, column: str, bins: int = 24) -> tuple[list[float], list[int]]:
        """(bins + 1) edges, and between them the counts of a column's values in rows that meet a condition. Raises what
        ``find`` raises."""
        name, condition = _quoted(column), where.strip() or "true"
        values = f"SELECT {name}::DOUBLE AS v FROM {of} WHERE (\n{condition}\n) AND isfinite({name}::DOUBLE)"
        low, high = self._ask(f"SELECT min(v), max(v) FROM ({values})", of)[0]
        if low is None:
            return [], []
        width = (high - low) / bins or 1.0
        place = f"least({bins - 1}, floor((v - {low!r}) / {width!r}))::INT"
        counts = dict(self._ask(f"SELECT {place} AS b, count(*) FROM ({values}) GROUP BY b", of))
        return [low + n * width for n in range(bins + 1)], [int(counts.get(n, 0)) for n in range(bins)]

    def counts(self, where: str, of: QueryTable, column: str, most: int = 30) -> list[tuple[str | None, int]]:
        """(value, rows with it) of a column in rows that meet a condition, the most frequent first. Raises what
        ``find`` raises."""
        name, condition = _quoted(column), where.strip() or "true"
        grouped = f"SELECT {name}::VARCHAR AS v, count(*) AS n FROM {of} WHERE (\n{condition}\n) GROUP BY v"
        return [(value, int(n)) for value, n in self._ask(f"{grouped} ORDER BY n DESC, v LIMIT {most}", of)]

    def _ask(self, sql: str, of: QueryTable) -> list[tuple[Any, ...]]:
        stop = threading.Timer(self._most_s, self._duckdb.interrupt) if self._most_s is not None else None
        try:
            if stop is not None:
                stop.start()
            statements = self._duckdb.extract_statements(sql)
            if len(statements) != 1 or statements[0].type != duckdb.StatementType.SELECT:
                raise BadInput("expected one condition, without a semicolon")
            return self._rows(statements[0])
        except duckdb.InterruptException:
            raise BadInput(f"the search was stopped after {self._most_s:g} s") from None
        except duckdb.Error as error:
            raise BadInput(self._reason(error, of)) from None
        finally:
            if stop is not None:
                stop.cancel()

    def _reason(self, error: Exception, of: QueryTable) -> str:
        """DuckDB's message, without the position in the generated statement."""
        first = _first_line(error)
        if unknown := _UNKNOWN_COLUMN.search(first):
            name = unknown[1]
            columns = [column[0] for column in self._duckdb.execute(f"SELECT * FROM {of} LIMIT 0").description or ()]
            hint = did_you_mean(name, columns) or (
                f"; a text needs single quotes: '{name}'; for the columns, see the reference page \"Tables of a fleet\""
            )
            return f'no column "{name}" in {of}{hint}'
        if _BEHIND_CONDITION.search(str(error)):
            return "condition: it is incomplete, or its parentheses do not match"
        _, _, said = first.partition(": ")
        return f"condition: {(said or first).rstrip()}"

    def _rows(self, query: str | duckdb.Statement) -> list[tuple[Any, ...]]:
        return self._interruptibly(lambda: self._duckdb.execute(query).fetchall())

    def _interruptibly(self, asked: Callable[[], Answer]) -> Answer:
        """The answer of a query. Ctrl-C ends it: the main thread waits where it can be interrupted, since DuckDB does
        not look for signals while its own threads work."""
        if threading.current_thread() is not threading.main_thread():
            return asked()
        with ThreadPoolExecutor(1, "duckdb") as beside:
            answer = beside.submit(asked)
            try:
                return answer.result()
            except KeyboardInterrupt:
                self._duckdb.interrupt()
                raise

    def _shut_in(self) -> None:
        """Queries may come from a page, so they can read only the batch's folder, and can fill neither the memory nor
        the disk of a server that is recording."""
        if self._most_s is not None:
            self._duckdb.execute(f"SET memory_limit = '{MOST_BYTES}B'")
            self._duckdb.execute("SET temp_directory = ''")
        if self.store.folder is None:
            self._duckdb.register_filesystem(self.store.system)
        self._duckdb.execute("SET allowed_directories = [$1]", [self._path("packed/")])
        for setting in ("autoinstall_known_extensions", "autoload_known_extensions", "enable_external_access"):
            self._duckdb.execute(f"SET {setting} = false")
        self._duckdb.execute("SET lock_configuration = true")

    def _make_view(self, shape: TableShape) -> None:
        files = [self._path(packed_file(shape.name, self.run, number)) for number in self._numbers]
        source = self._whole(f"read_parquet([{', '.join(_text(file) for file in files)}])", shape)
        if shape.name in ("drives", "scores"):
            self._duckdb.execute(f"CREATE VIEW {shape.name} AS SELECT * FROM {source}")
            return
        # one row a drive: joining it costs little, and lets a condition name what belongs to the drive
        about = "d.address, d.title, d.brightness, d.mean_speed_mps, d.mean_bend_radpm"
        time = "" if any(column.name == "t_s" for column in shape.columns) else ", (t.t_ns - d.began_ns) / 1e9 AS t_s"
        named = ""
        if shape.name == "events":
            kinds = "".join(f", kind = {_text(kind)} AS {_quoted(kind)}" for kind in event_kinds())
            named = kinds + "".join(f", coalesce({sql}, false) AS {name}" for name, sql in NAMED.items())
        self._duckdb.execute(
            f"CREATE VIEW {shape.name} AS SELECT t.*, {about}{time}{named} FROM {source} t JOIN drives d USING (drive)"
        )

    def _whole(self, source: str, shape: TableShape) -> str:
        """The source with every column of the table. An earlier version may not have written some; they are null."""
        written = {column[0] for column in self._duckdb.execute(f"SELECT * FROM {source} LIMIT 0").description or ()}
        missing = [
            f"NULL::{_TYPES[column.kind]} AS {_quoted(column.name)}"
            for column in shape.columns
            if column.name not in written
        ]
        return f"(SELECT {', '.join(['*', *missing])} FROM {source})" if missing else source

    def _path(self, name: str) -> str:
        """A file or folder as DuckDB calls it: in a store by the first of its protocol's names, ``abfs`` for ``az``."""
        if self.store.folder is not None:
            return f"{self.store.folder}/{name}"
        return str(self.store.system.unstrip_protocol(self.store.path(name)))


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _text(value: str) -> str:
    return "'" + value.replace("'", "''") + "'"


def _first_line(error: Exception) -> str:
    """What DuckDB says, without the statement that it adds."""
    return str(error).strip().splitlines()[0]


def _plain(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else None
    return value
