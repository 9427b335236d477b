"""Packs of tables, and questions to them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import threading
from pathlib import Path
from typing import Any, ClassVar

import fsspec
import pyarrow.parquet as pq
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from app.bench.fleet_tables import make_tables
from app.cli import main
from app.fleet import find
from app.fleet.batch.tables import EQUAL_TABLES, EVENTS, FRAMES
from app.fleet.batch.work import run_drive
from app.fleet.desk import FleetDesk
from app.fleet.find import FleetTables
from app.fleet.pack import finished, pack
from app.fleet.pack_index import packed_file, packs_of
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from tests.app.fleet.fleets import BAD, LENGTH, SESSIONS, begun, plan_of


class _SeveralNames(MemoryFileSystem):
    protocol = ("abfs", "az")
    store: ClassVar[dict[str, Any]] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]

    @classmethod
    def _strip_protocol(cls, path: str) -> str:
        return str(super()._strip_protocol(path.rpartition("://")[2]))


@pytest.fixture(scope="module")
def batch(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of the fleet with LiDAR alone, packed."""
    out = tmp_path_factory.mktemp("batch")
    work = begun(plan_of(fleet, sensors="lidar"), out)
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(out)), work.key.name)
    return out


@pytest.fixture
def tables(batch: Path) -> FleetTables:
    return FleetTables(Store(str(batch)))


def parts(batch: Path, name: str) -> list[dict]:
    """Every row of a table, from the files of drives."""
    return [
        row | {"drive": file.parent.name.removeprefix("drive=")}
        for file in sorted(batch.glob(f"tables/{name}/*/*/part.parquet"))
        for row in pq.read_table(file, partitioning=None).to_pylist()
    ]


def test_packs_hold_the_rows_of_every_drive(batch: Path, tables: FleetTables):
    for shape in EQUAL_TABLES:
        packed = pq.read_table(batch / packed_file(shape.name, tables.run, 0), partitioning=None)
        assert packed.column_names == ["drive", *(column.name for column in shape.columns)]
        assert packed.to_pylist() == [{"drive": row["drive"]} | row for row in parts(batch, shape.name)]


def test_a_bad_recording_has_no_rows(batch: Path, tables: FleetTables):
    drives = finished(tables.store, tables.run)
    assert len(drives) == SESSIONS
    assert not [drive for drive in drives if Path(BAD).stem in drive]


def test_events_by_name_and_by_sql(batch: Path, tables: FleetTables):
    events = parts(batch, EVENTS.name)
    kinds = {row["kind"] for row in events}
    assert "first_acquisition" in kinds
    for kind in kinds:
        assert tables.find(kind).total == sum(row["kind"] == kind for row in events)
    near = tables.find("first_acquisition AND distance_m < 30", columns=("distance_m",))
    expected = [row for row in events if row["kind"] == "first_acquisition" and row["distance_m"] < 30]
    assert near.total == len(expected) > 0
    assert near.columns == ("drive", "address", "index", "t_s", "distance_m")
    assert sorted(row[4] for row in near.rows) == pytest.approx(sorted(row["distance_m"] for row in expected), abs=1e-3)
    assert all(Path(row[1]).is_file() for row in near.rows)


def test_frames_objects_and_drives(batch: Path, tables: FleetTables):
    frames = parts(batch, FRAMES.name)
    assert tables.find("cipv_id IS NOT NULL", "frames").total == sum(row["cipv_id"] is not None for row in frames)
    assert tables.find("cipv", "objects").total == tables.find("cipv_id IS NOT NULL", "frames").total
    assert tables.find("", "drives").total == SESSIONS
    assert len(tables.find("", "frames", limit=5).rows) == 5
    assert tables.find("", "frames", limit=5).total == SESSIONS * LENGTH


def test_a_histogram_counts_what_was_found(tables: FleetTables):
    edges, counts = tables.histogram("cipv_id IS NOT NULL", "frames", "distance_m", 8)
    assert (len(edges), len(counts)) == (9, 8)
    assert sum(counts) == tables.find("cipv_id IS NOT NULL", "frames").total
    assert tables.histogram("false", "frames", "distance_m") == ([], [])


def test_counts_of_a_columns_values(batch: Path, tables: FleetTables):
    kinds = [row["kind"] for row in parts(batch, EVENTS.name)]
    found = tables.counts("", "events", "kind")
    assert dict(found) == {kind: kinds.count(kind) for kind in kinds}
    assert [count for _, count in found] == sorted((count for _, count in found), reverse=True)
    assert dict(tables.counts("false", "events", "kind")) == {}


def test_rows_come_in_the_order_that_is_asked_for(tables: FleetTables):
    for descending in (False, True):
        found = tables.find("", "frames", order="distance_m", descending=descending)
        shown = [row[found.columns.index("distance_m")] for row in found.rows]
        known = [value for value in shown if value is not None]
        assert known == sorted(known, reverse=descending)
        assert shown[: len(known)] == known
        assert None in shown
    with pytest.raises(BadInput, match='no column "no_such" in frames'):
        tables.find("", "frames", order="no_such")


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("sped_mps > 20", 'no column "sped_mps" in events; did you mean speed_mps?'),
        ('severity = "hefty"', "a text needs single quotes: 'hefty'"),
        ("speed_mps > > 20", 'condition: syntax error at or near ">"'),
        ("speed_mps >", "condition: it is incomplete, or its parentheses do not match"),
        ("(speed_mps > 20", "condition: it is incomplete, or its parentheses do not match"),
    ],
)
def test_what_is_wrong_with_a_condition_is_told_without_repeating_it(tables: FleetTables, typed: str, said: str):
    for wrapped in (typed, f"(\n{typed}\n)"):  # the page sends the second
        with pytest.raises(BadInput) as refused:
            tables.find(wrapped)
        assert said in str(refused.value)
        assert "\n" not in str(refused.value)
        assert wrapped not in str(refused.value)


def test_moments_of_a_frame_come_in_the_same_order_each_time(tables: FleetTables):
    for of, names in (("events", ("drive", "index", "kind")), ("objects", ("drive", "index", "distance_m"))):
        found = tables.find("", of, 1000, columns=("kind",) if of == "events" else ("distance_m",))  # type: ignore[arg-type]
        places = [found.columns.index(name) for name in names]
        rows = [tuple(row[n] for n in places) for row in found.rows]
        assert rows == sorted(rows, key=lambda row: (row[:2], row[2] is None, row[2]))


def test_a_question_without_end_is_stopped(batch: Path):
    endless = "(SELECT sum(a.range * b.range) FROM range(10000000) a, range(10000000) b) > 0"
    with pytest.raises(BadInput, match=r"stopped after 0\.2 s"):
        FleetTables(Store(str(batch)), most_s=0.2).find(endless)


def test_ctrl_c_ends_a_question(batch: Path):
    """The key is pressed repeatedly, because an interrupt during the import of a library is lost."""
    endless = "(SELECT sum(a.range * b.range) FROM range(10000000) a, range(10000000) b) > 0"
    tables, is_over = FleetTables(Store(str(batch)), most_s=60.0), threading.Event()

    def press() -> None:
        while not is_over.wait(0.3):
            os.kill(os.getpid(), signal.SIGINT)

    presses = threading.Thread(target=press)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    presses.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            tables.find(endless)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        is_over.set()
        presses.join()
        signal.signal(signal.SIGINT, before)


def test_a_question_fills_neither_the_memory_nor_the_disk(batch: Path, monkeypatch: pytest.MonkeyPatch):
    large = "(SELECT len(list(hash(range) ORDER BY hash(range))) FROM range(3000000)) > 0"
    monkeypatch.setattr(find, "MOST_BYTES", 20 << 20)
    with pytest.raises(BadInput, match="allocate"):
        FleetTables(Store(str(batch)), most_s=60.0).find(large)
    no_disk = FleetTables(Store(str(batch)), most_s=60.0).find("current_setting('temp_directory') = ''", "drives")
    assert no_disk.total == SESSIONS


def test_a_desk_finds_what_later_batches_add(fleet: Path, tmp_path: Path):
    inside, out = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    with pytest.raises(BadInput, match="no tables"):
        FleetDesk(str(out))
    shutil.copy(fleet / "near-0.mcap", inside / "near.mcap")
    run = _run_all(inside, out)
    desk = FleetDesk(str(out))
    assert desk.find(None, "", "drives", 1)[1].total == 1
    shutil.copy(fleet / "far-0.mcap", inside / "far.mcap")
    assert _run_all(inside, out) == run
    assert desk.find(run, "", "drives", 1)[1].total == 2
    assert desk.runs() == [run]


def test_drives_that_come_later_are_packed_too_and_replaced_ones_anew(fleet: Path, tmp_path: Path):
    inside, out = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    for name in ("near", "far"):
        shutil.copy(fleet / f"{name}-0.mcap", inside / f"{name}.mcap")
        run = _run_all(inside, out)
    store = Store(str(out))
    (first,) = packs_of(store, run)
    assert len(first.marks) == 2
    before = FleetTables(store).find("", "frames").total
    (inside / "near.mcap").write_bytes((fleet / "left-0.mcap").read_bytes())
    _run_all(inside, out)
    (second,) = packs_of(store, run)
    assert second.marks.keys() == first.marks.keys()
    assert second.marks != first.marks
    assert FleetTables(store).find("", "frames").total == before
    assert {row["t_ns"] for row in parts(out, FRAMES.name) if row["drive"].startswith("near")} != set()
    near = next(drive for drive in second.marks if drive.startswith("near"))
    packed = pq.read_table(out / packed_file("frames", run, 0), partitioning=None).to_pylist()
    assert [row["t_ns"] for row in packed if row["drive"] == near] == [
        row["t_ns"] for row in parts(out, FRAMES.name) if row["drive"] == near
    ]


def _run_all(inside: Path, out: Path) -> str:
    work = begun(plan_of(inside, sensors="lidar"), out)
    for job in work.jobs:
        run_drive(job)
    pack(Store(str(out)), work.key.name)
    return work.key.name


WRONG = {
    "no column": "no_such_column > 1",
    "another file": "drive IN (SELECT column0 FROM read_csv('/etc/passwd'))",
    "a second statement": "true) ; DROP VIEW events; SELECT (1",
    "writing": "true); COPY (SELECT 1) TO '/tmp/x.csv'; SELECT (true",
    "a setting": "true); SET enable_external_access = true; SELECT (true",
    "unfinished": "cut_in AND (",
}


@pytest.mark.parametrize("where", WRONG.values(), ids=WRONG)
def test_what_is_no_condition_is_refused_in_one_line(tables: FleetTables, where: str):
    with pytest.raises(BadInput) as refused:
        tables.find(where)
    assert "\n" not in str(refused.value).removeprefix(repr(where))


def test_only_the_packs_can_be_read(tables: FleetTables, batch: Path):
    with pytest.raises(BadInput, match="Cannot access"):
        tables.find(f"address IN (SELECT content FROM read_text('{batch / 'batch.json'}'))")


def test_tables_in_a_store_whose_protocol_has_several_names(batch: Path, tables: FleetTables):
    """adlfs answers to ``az``, but calls its own files ``abfs://…``."""
    fsspec.register_implementation("az", _SeveralNames, clobber=True)
    try:
        store = Store("az://fleet/out")
        for file in batch.rglob("*"):
            if file.is_file():
                store.put(str(file.relative_to(batch)), file)
        found = FleetTables(store).find("true", of="drives")
    finally:
        fsspec.register_implementation("az", "adlfs.AzureBlobFileSystem", clobber=True)
        _SeveralNames.store.clear()
    assert found == tables.find("true", of="drives")


def test_cipv_find_prints_rows_with_links(batch: Path, capsys: pytest.CaptureFixture[str]):
    assert _cipv("find", "first_acquisition", "--out", batch, "--json") == 0
    said = json.loads(capsys.readouterr().out)
    assert said["total"] == len(said["rows"]) > 0
    assert said["rows"][0]["link"].startswith("http://127.0.0.1:8420/#uri=")
    assert _cipv("find", "first_acquisition", "--out", batch) == 0
    assert "acquired at" in capsys.readouterr().out


def test_cipv_find_says_what_is_wrong_in_one_line(batch: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for typed in (
        ("find", "nonsense", "--out", batch),
        ("find", "cut_in", "--out", tmp_path),
        ("find", "cut_in", "--out", batch, "--run", "nothing"),
        ("find", "cut_in", "--out", batch, "--limit", "0"),
    ):
        assert _cipv(*typed) == 2
        said = capsys.readouterr().err.strip().splitlines()
        assert len(said) == 1, said
        assert said[0].startswith("cipv: ")


def _cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


def test_made_up_tables_are_as_real_ones(tmp_path: Path):
    """Checked with the benchmark's queries."""
    rows = make_tables(tmp_path, 3)
    tables = FleetTables(Store(str(tmp_path)))
    assert tables.find("", "frames").total == rows["frames"] == 1800
    assert 0 < tables.find("cut_in", "events").total < rows["events"]
