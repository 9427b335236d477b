"""Copying sessions to a folder, to S3 and to other stores: order, continuation, checks, and what is not copied."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import fsspec
import pytest
import s3fs

from app.cli import main
from app.fleet.store import Store
from app.fleet.sync.pace import Pace
from app.fleet.sync.s3_parts import PART_BYTES
from app.fleet.sync.sending import BLOCK_BYTES, sender
from app.fleet.sync.sync import Sync, SyncOptions, SyncTally
from pipeline.common.errors import BadInput
from pipeline.common.files import remote_files
from pipeline.common.progress import silent
from pipeline.recording.session.source import SessionSource
from tests.app.fleet.s3 import BUCKET, Unsteady, s3_server
from tests.app.fleet.sync.drives import record
from tests.pipeline.recording.frames import full, write

S3 = f"s3://{BUCKET}/car-7"
Begun = list[tuple[str, int]]


@pytest.fixture
def car(tmp_path: Path) -> Path:
    """Two sessions without events, the younger one first by name, and one that is still being recorded."""
    folder = tmp_path / "car"
    (folder / "may").mkdir(parents=True)
    write(folder / "may" / "b.mcap", [full(index) for index in range(6)])
    write(folder / "a.mcap", [full(index) for index in range(600, 604)])
    whole = (folder / "a.mcap").read_bytes()
    (folder / "now.mcap").write_bytes(whole[: len(whole) // 2])
    return folder


def synced(car: Path, address: str, **options: Any) -> tuple[Sync, Begun]:
    """A run, and the files it sent, in order."""
    begun: Begun = []

    def begin(what: str, size: int) -> Any:
        begun.append((what, size))
        return silent

    sync = Sync(car, Store(address), SyncOptions(**options), begin, SyncTally())
    sync.run()
    return sync, begun


def there(address: str) -> dict[str, bytes]:
    store = Store(address)
    return {name: store.read(name) or b"" for name in store.names("")}


@pytest.fixture
def in_memory() -> Iterator[str]:
    yield "memory://car-7"
    fsspec.filesystem("memory").rm("/car-7", recursive=True)


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


class Stop(Exception):
    """The car is switched off."""


def test_a_file_is_continued_where_it_stopped_on_disk(tmp_path: Path):
    data = bytes(range(256)) * (4 * BLOCK_BYTES // 256) + b"end"
    (tmp_path / "a.mcap").write_bytes(data)
    send = sender(Store(str(tmp_path / "nas"))).send
    with pytest.raises(Stop):
        send("a.mcap", tmp_path / "a.mcap", Pace(), stopping_after(2))
    assert not (tmp_path / "nas/a.mcap").exists(), "half a file under its name"
    slept: list[float] = []
    pace = Pace(BLOCK_BYTES, clock=lambda: 0.0, sleep=slept.append)
    assert send("a.mcap", tmp_path / "a.mcap", pace, silent) == hashlib.sha256(data).hexdigest()
    assert sum(slept) == pytest.approx(1 + 3 / BLOCK_BYTES), "what was there is not written again"
    assert (tmp_path / "nas/a.mcap").read_bytes() == data
    assert [each.name for each in (tmp_path / "nas").iterdir()] == ["a.mcap"]


def test_a_part_that_is_of_another_file_is_not_continued(tmp_path: Path):
    data = bytes(BLOCK_BYTES) + b"end"
    (tmp_path / "a.mcap").write_bytes(data)
    (tmp_path / "nas").mkdir()
    (tmp_path / "nas/.a.mcap.part").write_bytes(b"x" * (3 * BLOCK_BYTES))
    sender(Store(str(tmp_path / "nas"))).send("a.mcap", tmp_path / "a.mcap", Pace(), silent)
    assert (tmp_path / "nas/a.mcap").read_bytes() == data


def stopping_after(calls: int) -> Any:
    left = iter(range(calls))

    def progress(done: int, total: int) -> None:
        if next(left, None) is None:
            raise Stop

    return progress


class Spoils:
    """A WSGI program in front of another one: it counts uploaded parts and corrupts a byte in some of them."""

    def __init__(self, program: Any, spoiled: Iterable[int]) -> None:
        self._program, self._spoiled, self.parts = program, set(spoiled), 0

    def __call__(self, environ: dict[str, Any], start: Any) -> Iterable[bytes]:
        if "partNumber=" in environ.get("QUERY_STRING", ""):
            if self.parts in self._spoiled:
                environ["wsgi.input"] = OneByteOff(environ["wsgi.input"])
            self.parts += 1
        return self._program(environ, start)


class OneByteOff:
    def __init__(self, stream: Any) -> None:
        self._stream, self._is_done = stream, False

    def read(self, *size: int) -> bytes:
        data = bytearray(self._stream.read(*size))
        if len(data) > 1000 and not self._is_done:
            data[-500] ^= 1
            self._is_done = True
        return bytes(data)


def spoil(server: Unsteady, *parts: int) -> Spoils:
    server._program = Spoils(server._program, parts)
    return server._program


@pytest.fixture
def large(tmp_path: Path) -> tuple[Path, bytes]:
    """A file of three parts."""
    data = b"".join(bytes([n]) * PART_BYTES for n in range(2)) + b"end" * 1000
    (tmp_path / "a.mcap").write_bytes(data)
    return tmp_path / "a.mcap", data


def test_a_file_is_continued_where_it_stopped_in_s3(large: tuple[Path, bytes], monkeypatch: pytest.MonkeyPatch):
    file, data = large
    with s3_server(monkeypatch, every=0) as server:
        counted = spoil(server)
        send = sender(Store(S3)).send
        with pytest.raises(Stop):
            send("a.mcap", file, Pace(), stopping_after(1))
        assert there(S3) == {}
        before = counted.parts
        assert send("a.mcap", file, Pace(), silent) == hashlib.sha256(data).hexdigest()
        assert (before, counted.parts) == (2, 3), "parts that had arrived were sent again"
        assert there(S3)["a.mcap"] == data


def test_what_arrives_damaged_is_sent_again(large: tuple[Path, bytes], monkeypatch: pytest.MonkeyPatch):
    file, data = large
    with s3_server(monkeypatch, every=0) as server:
        counted = spoil(server, 1)
        sender(Store(S3)).send("a.mcap", file, Pace(), silent)
        assert counted.parts == 4
        assert there(S3)["a.mcap"] == data


def test_what_arrives_damaged_each_time_is_reported_and_the_others_copied(
    car: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    with s3_server(monkeypatch, every=0) as server:
        spoil(server, 0, 1, 2)
        assert cipv("sync", S3, "--from", car, "--no-clips", "--json") == 1
        said = capsys.readouterr()
        told = json.loads(said.out)
        assert (told["sessions"], list(told["failed"])) == (1, ["may/b"])
        assert "another checksum" in told["failed"]["may/b"]
        assert "sessions/a.mcap" in there(S3)
        assert "sessions/may/b.mcap.sha256" not in there(S3)


def test_the_rate_is_held_without_making_up_for_pauses():
    now, slept = [0.0], []

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += seconds

    pace = Pace(1000.0, clock=lambda: now[0], sleep=sleep)
    for _ in range(3):
        now[0] += 60.0
        pace.sending()
        now[0] += 0.5
        pace.sent(2000)
    pace.sending()
    now[0] += 5.0
    pace.sent(2000)
    assert slept == pytest.approx([1.5, 1.5, 1.5, 0.0])


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


def cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)


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


def spoil_copy(address: str, name: str) -> bytes:
    """Change one byte of a file in a store. Returns what it was."""
    store = Store(address)
    data = store.read(name)
    assert data is not None
    store.write(name, data[:99] + bytes([data[99] ^ 1]) + data[100:])
    return data


def check_damaged(car: Path, address: str) -> None:
    """Check that a copy of equal size with another byte is noticed when asked for, and sent again."""
    synced(car, address, clips=False)
    before = spoil_copy(address, "sessions/a.mcap")
    assert synced(car, address, clips=False)[1] == [], "sizes are equal"
    sync, begun = synced(car, address, clips=False, verify=True)
    assert sync.tally.damaged == ["a"]
    assert [what for what, _ in begun] == ["checking may/b", "checking a", "a"]
    assert Store(address).read("sessions/a.mcap") == before
    assert synced(car, address, clips=False, verify=True)[0].tally.damaged == []


def test_a_damaged_copy_in_a_folder_is_sent_again(car: Path, tmp_path: Path):
    check_damaged(car, str(tmp_path / "nas"))


def test_a_damaged_copy_in_a_store_is_sent_again(car: Path, in_memory: str):
    check_damaged(car, in_memory)


def test_a_damaged_copy_in_s3_is_sent_again(car: Path, monkeypatch: pytest.MonkeyPatch):
    with s3_server(monkeypatch, every=7):
        check_damaged(car, S3)


def test_a_damaged_copy_is_not_replaced_by_what_was_never_sent(car: Path, tmp_path: Path):
    address = str(tmp_path / "nas")
    synced(car, address, clips=False)
    spoil_copy(address, "sessions/a.mcap")
    spoil_copy(str(car), "a.mcap")
    sync, _ = synced(car, address, clips=False, verify=True)
    assert sync.tally.sessions == 0
    assert "is not what was sent" in sync.tally.failed["a"]


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
