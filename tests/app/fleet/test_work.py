"""One drive of a batch: its tables, against `cipv run`; what is done once; what is set aside."""

from __future__ import annotations

import json
import os
import tracemalloc
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import zstandard

from app.cli import main
from app.drive.events import event_kinds
from app.fleet.batch.answers import unpacked
from app.fleet.batch.job import Outcome, TooLong
from app.fleet.batch.plan import Plan, work_of
from app.fleet.batch.tables import EVENTS, FRAMES, OBJECTS, SCORES, TABLES, file_of
from app.fleet.batch.work import WrongWorker, look_at_piece, run_drive
from app.fleet.runs import set_aside
from app.fleet.store import Store
from pipeline.params import Params, with_changes
from tests.app.fleet.fleets import BAD, begun, contents, job_of, plan_of


@pytest.fixture(scope="module")
def ran(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A batch of one drive."""
    out = tmp_path_factory.mktemp("ran")
    outcome = run_drive(job_of(str(fleet / "near-0.mcap"), out, keeps_results=True))
    assert isinstance(outcome, Outcome)
    assert (outcome.frames, outcome.looked_at, outcome.reason) == (8, 8, "")
    return out


def results_of(fleet: Path, tmp_path: Path) -> list[dict]:
    out = tmp_path / "results.jsonl"
    typed = ["run", str(fleet / "near-0.mcap"), "--out", str(out), "--lanes", "off", "--far-view-px", "0"]
    with pytest.raises(SystemExit) as end:
        main(typed)
    assert end.value.code == 0
    return [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]


def test_results_are_those_of_cipv_run(fleet: Path, ran: Path, tmp_path: Path):
    expected = [row | {"timing_ms": {}} for row in results_of(fleet, tmp_path)]
    (packed,) = ran.glob("results/*/*.jsonl.zst")
    lines = zstandard.ZstdDecompressor().decompressobj().decompress(packed.read_bytes()).decode().splitlines()
    assert lines == [json.dumps(row, ensure_ascii=False, separators=(",", ":")) for row in expected]


def table(out: Path, name: str) -> list[dict]:
    (part,) = out.glob(f"tables/{name}/*/*/part.parquet")
    return pq.read_table(part, partitioning=None).to_pylist()


def test_tables_hold_what_the_results_say(fleet: Path, ran: Path, tmp_path: Path):
    expected = results_of(fleet, tmp_path)
    frames, objects = table(ran, FRAMES.name), table(ran, OBJECTS.name)
    assert [row["name"] for row in frames] == [row["frame"] for row in expected]
    assert [row["cipv_id"] for row in frames] == [row["cipv"] and row["cipv"]["id"] for row in expected]
    assert [(row["index"], row["id"], row["source"], row["in_path"]) for row in objects] == [
        (index, each["id"], each["source"], each["in_path"])
        for index, row in enumerate(expected)
        for each in row["objects"]
    ]
    theirs = [each["distance_m"] for row in expected for each in row["objects"]]
    ours = [row["distance_m"] for row in objects]
    assert ours == [None if value is None else pytest.approx(value, abs=1e-3) for value in theirs]
    assert any(row["cipv"] for row in objects)


def test_every_table_has_the_columns_that_are_declared(ran: Path):
    for shape in TABLES:
        (part,) = ran.glob(f"tables/{shape.name}/*/*/part.parquet")
        assert pq.read_schema(part) == shape.schema()


def test_events_and_scores_are_there(ran: Path):
    assert {row["kind"] for row in table(ran, EVENTS.name)} <= set(event_kinds())
    assert table(ran, EVENTS.name)
    scores = {row["score"]: row for row in table(ran, SCORES.name)}
    assert {"jitter", "labelled.cipv_correct"} <= scores.keys()
    assert scores["labelled.cipv_correct"]["under"] == 8


def test_what_is_done_is_not_done_again(fleet: Path, ran: Path):
    job = job_of(str(fleet / "near-0.mcap"), ran)
    before = contents(ran)
    assert run_drive(job) == Outcome(job.recording.drive, 8, 0, 0.0)
    assert contents(ran) == before


def test_other_parameters_are_another_run_whose_images_no_network_looks_at(fleet: Path, ran: Path):
    job = job_of(str(fleet / "near-0.mcap"), ran)
    other = with_changes(Params(), {"cluster.z_weight": 0.3})
    outcome = run_drive(replace(job, key=replace(job.key, params=other)))
    assert isinstance(outcome, Outcome)
    assert (outcome.frames, outcome.looked_at) == (8, 0)


def test_pieces_give_the_same_bytes_as_the_whole(fleet: Path, ran: Path, tmp_path: Path):
    job = job_of(str(fleet / "near-0.mcap"), tmp_path, keeps_results=True, piece_frames=3)
    split = run_drive(job, may_split=True)
    assert split == TooLong((0, 3, 6))
    assert [look_at_piece(job, first) for first in (6, 0, 3)] == [2, 3, 3]
    assert look_at_piece(job, 3) == 0, "looked at twice"
    outcome = run_drive(job, may_split=True)
    assert isinstance(outcome, Outcome)
    assert outcome.looked_at == 0
    here = {name: sha for name, sha in contents(tmp_path).items() if not name.startswith("boxes/")}
    run = job.key.name
    assert here == {name: sha for name, sha in contents(ran).items() if f"run={run}" in name}
    assert file_of("frames", run, job.recording.drive) in here


def test_damaged_answers_are_asked_anew(fleet: Path, ran: Path, tmp_path: Path):
    job = job_of(str(fleet / "near-0.mcap"), tmp_path, keeps_results=True)
    (kept,) = ran.glob("boxes/*/*/*.bin")
    Store(str(tmp_path)).write(str(kept.relative_to(ran)), kept.read_bytes()[:-9])
    outcome = run_drive(job)
    assert isinstance(outcome, Outcome)
    assert outcome.looked_at == 8


def test_answers_that_declare_gigabytes_are_asked_anew() -> None:
    """Memory of the declared size would be allocated before anything is unpacked."""
    data = bytearray(zstandard.ZstdCompressor().compress(bytes(1 << 24)))
    size = (1 << 24).to_bytes(4, "little")
    assert bytes(data).count(size, 0, 12) == 1
    at = data.index(size)
    data[at : at + 4] = (1 << 31).to_bytes(4, "little")
    assert zstandard.frame_content_size(bytes(data)) == 1 << 31
    tracemalloc.start()
    try:
        assert unpacked(bytes(data)) == {}
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 1 << 20


def test_a_bad_recording_is_set_aside_with_the_reason(fleet: Path, tmp_path: Path):
    job = job_of(str(fleet / BAD), tmp_path)
    outcome = run_drive(job)
    assert isinstance(outcome, Outcome)
    assert outcome.frames == 0
    assert outcome.reason
    assert BAD not in outcome.reason  # the address is told beside it
    again = run_drive(job)
    assert isinstance(again, Outcome)
    assert again.reason == outcome.reason
    assert not (tmp_path / "tables").exists()


def test_a_name_that_is_no_text_is_set_aside(fleet: Path, tmp_path: Path):
    name = Path(os.fsdecode(b"bad\xff.mcap"))
    (tmp_path / name).write_bytes((fleet / "near-0.mcap").read_bytes())
    work = begun(plan_of(tmp_path), tmp_path / "out")
    outcome = run_drive(work.jobs[0])
    assert isinstance(outcome, Outcome)
    assert "UTF-8" in outcome.reason
    assert set_aside(work.store, work.key.name) == {str(tmp_path / name): outcome.reason}
    assert work_of(Plan.load(work.store), work.store).jobs == ()


def test_a_worker_with_other_code_or_networks_is_told(fleet: Path, tmp_path: Path):
    job = job_of(str(fleet / "near-0.mcap"), tmp_path)
    with pytest.raises(WrongWorker, match="does not have the same version"):
        run_drive(replace(job, key=replace(job.key, code="other")))
    with pytest.raises(WrongWorker, match="networks"):
        look_at_piece(replace(job, key=replace(job.key, networks="other")), 0)
