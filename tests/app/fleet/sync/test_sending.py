"""Sending one file: continued where it stopped, sent again if it arrives damaged, at a limited rate."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest

from app.fleet.store import Store
from app.fleet.sync.pace import Pace
from app.fleet.sync.s3_parts import PART_BYTES
from app.fleet.sync.sending import BLOCK_BYTES, sender
from pipeline.common.progress import silent
from tests.app.fleet.s3 import Unsteady, s3_server
from tests.app.fleet.sync.copies import S3, cipv, there


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
