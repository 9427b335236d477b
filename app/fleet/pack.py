"""Packs the small parts of tables, so that a query on ten thousand drives opens a few dozen files.

Workers write one small file per table and drive. Packs hold the same rows of a few hundred drives, with the drive's
name as the first column. They are rebuilt from the parts whenever these change."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from app.fleet.batch.tables import EQUAL_TABLES, TableShape, file_of
from app.fleet.pack_index import Pack, keep_index, packed_file, packs_of
from app.fleet.store import Store
from pipeline.common.ahead import ahead
from pipeline.common.errors import BadInput
from pipeline.common.progress import Progress, silent

PACK_DRIVES = 500
"""Drives of one pack."""
_GROUP_ROWS = 100_000
_READERS = 16


def pack(store: Store, run: str, progress: Progress = silent) -> None:
    """Pack the finished drives of a run. Packs that are up to date are kept. progress: of packs."""
    done = finished(store, run)
    wanted = [*_planned(packs_of(store, run), done)]
    for number, fresh in enumerate(wanted):
        _write(store, run, fresh)
        progress(number + 1, len(wanted))
        keep_index(store, run, fresh)


def finished(store: Store, run: str) -> dict[str, str]:
    """Drive → mark of every drive with tables in a run."""
    found: dict[str, list[str]] = {}
    for name in store.names(f"done/run={run}"):
        drive, mark, _ = name.rpartition("/")[2].rsplit(".", 2)
        found.setdefault(drive, []).append(mark)
    return {drive: marks[0] if len(marks) == 1 else _mark_of(store, run, drive) for drive, marks in found.items()}


def _mark_of(store: Store, run: str, drive: str) -> str:
    """Of a recording that was replaced, whose drive was run twice: the mark that its tables are of."""
    return str(_part(store, "drives", run, drive).column("mark")[0].as_py())


def _planned(packs: Sequence[Pack], done: Mapping[str, str]) -> Iterator[Pack]:
    """The packs to write: those with drives that changed, and full ones of new drives, the last one filled up."""
    known = {drive for each in packs for drive in each.marks}
    new = sorted(done.keys() - known)
    for each in packs:
        marks = {drive: done[drive] for drive in each.marks if drive in done}
        if each is packs[-1] and new:
            room = PACK_DRIVES - len(marks)
            marks |= {drive: done[drive] for drive in new[:room]}
            new = new[room:]
        if marks != each.marks:
            yield Pack(each.number, marks)
    for number, first in enumerate(range(0, len(new), PACK_DRIVES), len(packs)):
        yield Pack(number, {drive: done[drive] for drive in new[first : first + PACK_DRIVES]})


def _write(store: Store, run: str, fresh: Pack) -> None:
    with TemporaryDirectory(prefix="cipv-pack-") as folder:
        for shape in EQUAL_TABLES:
            file = Path(folder) / f"{shape.name}.parquet"

            def read(drive: str, name: str = shape.name) -> tuple[str, pa.Table]:
                return drive, _part(store, name, run, drive)

            write_pack(file, shape, ahead(read, fresh.marks, _READERS))
            store.put(packed_file(shape.name, run, fresh.number), file)


def write_pack(file: Path, shape: TableShape, parts: Iterable[tuple[str, pa.Table]]) -> None:
    """One pack of a table. parts: drives with their rows."""
    schema = pa.schema([pa.field("drive", pa.string()), *shape.schema()])
    with pq.ParquetWriter(file, schema, compression="zstd") as writer:
        held: list[pa.Table] = []
        rows = 0
        for drive, part in parts:
            held.append(part.add_column(0, "drive", pa.array([drive] * part.num_rows, pa.string())))
            rows += part.num_rows
            if rows >= _GROUP_ROWS:
                writer.write_table(pa.concat_tables(held))
                held, rows = [], 0
        if held:
            writer.write_table(pa.concat_tables(held))


def _part(store: Store, table: str, run: str, drive: str) -> pa.Table:
    name = file_of(table, run, drive)
    data = store.read(name)
    if data is None:
        raise BadInput(f"{store.address}/{name} is missing; remove done/run={run}/{drive}.* and run the batch again")
    return pq.ParquetFile(io.BytesIO(data)).read()
