"""Tables that an earlier version wrote, and files that are gone or damaged."""

from __future__ import annotations

from pathlib import Path

import pyarrow.parquet as pq
import pytest

from app.bench.fleet_tables import make_tables
from app.fleet.batch.tables import EQUAL_TABLES
from app.fleet.find import FleetTables
from app.fleet.mining.seconds import seconds_of
from app.fleet.pack_index import packed_file
from app.fleet.store import Store
from pipeline.common.errors import BadInput

LATER = {"events": "max_gap_sigmas", "drives": "brightness", "frames": "vl_gap_sigmas", "objects": "in_path"}
"""Table → a column that the earlier version did not have; some of them stand in named conditions and views."""


@pytest.fixture
def older(tmp_path: Path) -> Path:
    make_tables(tmp_path, 3)
    for table, column in LATER.items():
        file = file_of(tmp_path, table)
        pq.write_table(pq.read_table(file, partitioning=None).drop_columns([column]), file)
    return tmp_path


def file_of(folder: Path, table: str) -> Path:
    (run,) = (file.stem.removeprefix("run=") for file in (folder / "packed").glob("run=*.json"))
    return folder / packed_file(table, run, 0)


@pytest.mark.parametrize("table", LATER)
def test_what_was_not_written_is_unknown(older: Path, table: str):
    tables = FleetTables(Store(str(older)))
    column = LATER[table]
    everything = tables.find("", table).total  # type: ignore[arg-type]
    assert tables.find(f"{column} IS NULL", table).total == everything > 0  # type: ignore[arg-type]
    (row, *_) = tables.rows(table)  # type: ignore[arg-type]
    shape = next(each for each in EQUAL_TABLES if each.name == table)
    assert {each.name for each in shape.columns} <= row.keys()


def test_named_conditions_on_it_hold_nowhere(older: Path):
    tables = FleetTables(Store(str(older)))
    assert tables.find("disagreement").total == tables.find("night").total == 0
    assert tables.find("close").total > 0
    assert tables.histogram("", "events", "max_gap_sigmas") == ([], [])
    assert len(seconds_of(tables).second)


@pytest.mark.parametrize("damage", [Path.unlink, lambda file: file.write_bytes(b"PAR1" + bytes(40))])
def test_a_file_that_cannot_be_read_is_said_in_one_line(older: Path, damage: object):
    damage(file_of(older, "objects"))  # type: ignore[operator]
    with pytest.raises(BadInput, match=r"table objects of run .* cannot be read: .* packs it again") as said:
        FleetTables(Store(str(older)))
    assert "\n" not in str(said.value)
