"""Copying sessions to a folder, to S3 and to other stores: order, what is not copied, and what goes wrong."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
import s3fs

from app.fleet.store import Store
from app.fleet.sync.sync import Sync, SyncOptions, SyncTally
from pipeline.common.errors import BadInput
from pipeline.common.files import remote_files
from pipeline.common.progress import silent
from pipeline.recording.session.source import SessionSource
from tests.app.fleet.s3 import s3_server
from tests.app.fleet.sync.copies import S3, cipv, synced, there
from tests.app.fleet.sync.drives import record
from tests.pipeline.recording.frames import full, write


def check(car: Path, address: str) -> None:
    """Check that exactly the finished files are in the store, unchanged."""
    sync, begun = synced(car, address, clips=False)
    assert [what for what, _ in begun] == ["may/b", "a"], "the oldest first"
    assert (sync.tally.sessions, sync.tally.before, sync.tally.unfinished) == (2, 0, ["now"])
    found = there(address)
    assert found.keys() == {f"sessions/{name}.mcap{end}" for name in ("a", "may/b") for end in ("", ".sha256")}
    for name in ("a", "may/b"):
        data = (car / f"{name}.mcap").read_bytes()
        assert found[f"sessions/{name}.mcap"] == data
        said = f"{hashlib.sha256(data).hexdigest()}  {Path(name).name}.mcap\n"
        assert found[f"sessions/{name}.mcap.sha256"].decode() == said
    again, begun = synced(car, address, clips=False)
    assert (begun, again.tally.before) == ([], 2)


def test_to_a_folder(car: Path, tmp_path: Path):
    check(car, str(tmp_path / "nas"))


def test_copies_below_the_folder_of_sessions_are_not_copied_again(car: Path):
    check(car, str(car / "copies"))
    with pytest.raises(BadInput, match="into itself"):
        synced(car, str(car))


def test_to_a_folder_around_that_of_sessions(car: Path):
    _, begun = synced(car, str(car.parent), clips=False)
    assert [what for what, _ in begun] == ["may/b", "a"]


def test_to_s3_whose_requests_fail(car: Path, monkeypatch: pytest.MonkeyPatch):
    with s3_server(monkeypatch, every=5) as server:
        check(car, S3)
        assert server.failed > 3


def test_to_another_store(car: Path, in_memory: str):
    check(car, in_memory)


def test_clips_come_first_and_say_what_happened(car: Path, tmp_path: Path):
    record(car / "c.mcap")
    address = str(tmp_path / "nas")
    _, begun = synced(car, address, around_s=0.3)
    sent = [what for what, _ in begun if not what.startswith("events of")]
    assert len(sent) > 4
    assert sent[-3:] == ["may/b", "c", "a"] or sent[-3:] == ["c", "may/b", "a"]
    assert all(what.startswith("c-") for what in sent[:-3])
    said = json.loads((tmp_path / "nas/events/c.json").read_text(encoding="utf-8"))
    assert [each["clip"] for each in said["clips"]] == [f"events/{what}.mcap" for what in sent[:-3]]
    kinds = {event["kind"] for each in said["clips"] for event in each["events"]}
    assert {"mark", "cut_in"} <= kinds
    session = SessionSource("c", str(car / "c.mcap"))
    for each in said["clips"]:
        file = tmp_path / "nas" / each["clip"]
        clip = SessionSource("clip", str(file))
        assert hashlib.sha256(file.read_bytes()).hexdigest() == each["sha256"]
        assert len(clip) == each["last"] + 1 - each["first"]
        assert clip.frame(0).name == session.frame(each["first"]).name
    assert json.loads((tmp_path / "nas/events/a.json").read_text(encoding="utf-8"))["clips"] == []
    assert synced(car, address, around_s=0.3)[1] == []


def test_a_session_that_ends_meanwhile_sends_its_clips_before_older_sessions(car: Path, tmp_path: Path):
    """The recording ends while the first session is being sent."""
    sent: list[str] = []

    def begin(what: str, _: int) -> Any:
        sent.append(what)
        if what == "may/b":
            record(car / "late.mcap")
        return silent

    Sync(car, Store(str(tmp_path / "nas")), SyncOptions(), begin, SyncTally()).run()
    clips = [place for place, what in enumerate(sent) if what.startswith("late-")]
    assert clips
    assert sent.index("may/b") < clips[0] <= clips[-1] < sent.index("a")


def test_another_cars_session_of_the_same_name_is_not_replaced(
    car: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    synced(car, str(tmp_path / "nas"), clips=False)
    before = there(str(tmp_path / "nas"))
    (car / "a.mcap").unlink()
    write(car / "a.mcap", [full(index) for index in range(600, 609)])
    assert cipv("sync", tmp_path / "nas", "--from", car, "--no-clips") == 1
    assert "another recording; give each car an address of its own" in capsys.readouterr().err
    assert there(str(tmp_path / "nas")) == before


def test_a_session_that_cannot_be_read_is_copied_without_clips(car: Path, tmp_path: Path):
    (car / "odd.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(300) + b"\x89MCAP0\r\n")
    sync, _ = synced(car, str(tmp_path / "nas"))
    assert list(sync.tally.notes) == ["odd"]
    assert (tmp_path / "nas/sessions/odd.mcap").read_bytes() == (car / "odd.mcap").read_bytes()


def test_cipv_sync(car: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    typed = ("sync", tmp_path / "nas", "--from", car, "--limit", "900", "--json")
    assert cipv(*typed) == 0
    said = capsys.readouterr()
    first = json.loads(said.out)
    sizes = [(car / name).stat().st_size for name in ("a.mcap", "may/b.mcap")]
    assert (first["sessions"], first["bytes"], first["unfinished"]) == (2, sum(sizes), ["now"])
    assert "now: still being recorded, or cut off" in said.err
    assert cipv(*typed) == 0
    second = json.loads(capsys.readouterr().out)
    assert (second["sessions"], second["sessions_before"]) == (0, 2)


def test_an_interrupted_copy_says_that_the_next_one_continues(
    car: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def interrupted(_: Sync) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Sync, "run", interrupted)
    assert cipv("sync", tmp_path / "nas", "--from", car) == 130
    assert capsys.readouterr().err == "cipv: interrupted; the next `cipv sync` continues\n"


def test_a_folder_that_cannot_be_written_ends_the_run(car: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "nas").write_text("a file")
    assert cipv("sync", tmp_path / "nas", "--from", car, "--no-clips") == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 2, said
    assert "cannot be written: Not a directory; the next" in said[0]


def test_a_store_that_is_away_is_reported_without_a_traceback(
    car: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr(remote_files.time, "sleep", lambda _: None)
    monkeypatch.setattr(s3fs.S3FileSystem, "retries", 1)
    monkeypatch.setenv("AWS_MAX_ATTEMPTS", "1")
    with s3_server(monkeypatch, every=0) as server:
        server.every = 1
        assert cipv("sync", S3, "--from", car) == 1
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 2, said
    assert said[0].startswith(f"cipv: {S3}")
    assert said[0].endswith("the next `cipv sync` continues")
    assert said[1].startswith("cipv: 0 sessions")


WRONG = {
    "a web server": ("https://example.org/car", "--from", "car"),
    "no such folder": ("nas", "--from", "nowhere"),
    "a store nobody knows": ("ftp://car", "--from", "car"),
    "no rate": ("nas", "--from", "car", "--limit", "0"),
    "a long time": ("nas", "--from", "car", "--around", "99999"),
}


@pytest.mark.parametrize("arguments", WRONG.values(), ids=WRONG)
def test_bad_input_is_said_in_one_line(
    car: Path, tmp_path: Path, arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
):
    own = {"car": str(car), "nas": str(tmp_path / "nas"), "nowhere": str(tmp_path / "nowhere")}
    assert cipv("sync", *(own.get(each, each) for each in arguments)) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1, said
    assert said[0].startswith("cipv: ")
    assert not (tmp_path / "nas").exists()
