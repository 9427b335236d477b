"""Files in stores: valid addresses, retries and error messages."""

from __future__ import annotations

import logging
import os
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import fsspec
import pytest

from pipeline.common.files import remote_files
from pipeline.common.files.remote_files import NotReachable, is_remote, open_remote, patiently
from pipeline.common.files.user_files import Overloaded
from pipeline.recording.session.source import SessionSource
from pipeline.sources import SourceError, open_source
from pipeline.sources.fingerprint import fingerprint
from tests.pipeline.recording.frames import full, same, write

ADDRESS = "memory://fleet/a.mcap"


@pytest.fixture
def session(tmp_path):
    """A session in a store in memory, and the same session on disk."""
    path = write(tmp_path / "a.mcap", [full(index) for index in range(6)])
    store = fsspec.filesystem("memory")
    store.pipe_file("/fleet/a.mcap", path.read_bytes())
    yield path
    store.rm("/fleet", recursive=True)


@pytest.fixture
def in_no_time(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(remote_files.time, "sleep", lambda _: None)


def test_what_is_an_address():
    assert is_remote("s3://bucket/a.mcap")
    assert not any(map(is_remote, ("sim:straight", "a.mcap", "c://x", "file:///a.mcap", "/a://b", "kitti:/a")))


def test_a_session_in_a_store_is_read_as_on_the_disk(session):
    there, here = open_source(ADDRESS), SessionSource("a", str(session))
    assert len(there) == len(here) == 6
    for index in range(6):
        assert same(there.frame(index), here.frame(index))
        assert there.truth(index) == here.truth(index)


def test_only_what_is_needed_is_read(session, monkeypatch: pytest.MonkeyPatch):
    """Of a large file, the index and one frame's chunk."""
    asked: list[tuple[int, int]] = []
    store = fsspec.filesystem("memory")
    honest = store.cat_file

    def counted(path, start=None, end=None, **more):
        asked.append((start, end))
        return honest(path, start=start, end=end, **more)

    padded = bytearray(session.read_bytes())
    monkeypatch.setattr(type(store), "cat_file", lambda self, *given, **more: counted(*given, **more))
    monkeypatch.setattr(remote_files, "BLOCK_BYTES", 1024)
    open_source(ADDRESS).frame(0)
    assert asked
    assert max(end - start for start, end in asked) < len(padded)
    assert len(set(asked)) == len(asked), "an index is read in many steps, each block of it once"


def test_what_gcsfs_leaves_behind_is_no_message_to_a_user(session, caplog: pytest.LogCaptureFixture):
    """DuckDB drops its files without closing them, and gcsfs reads ahead of them."""
    open_source(ADDRESS)
    complaints = logging.getLogger("asyncio")
    complaints.error("Task was destroyed but it is pending! coro=<PrefetchProducer._loop()>")
    complaints.error("Task was destroyed but it is pending! coro=<ours()>")
    assert [each.getMessage().rpartition("=")[2] for each in caplog.records] == ["<ours()>"]


def test_a_file_that_is_replaced_has_another_fingerprint(session):
    before = fingerprint(ADDRESS)
    assert fingerprint(ADDRESS) == before
    fsspec.filesystem("memory").pipe_file("/fleet/a.mcap", session.read_bytes() + b"x")
    assert fingerprint(ADDRESS) != before


def test_a_store_that_fails_for_a_while_is_asked_again(in_no_time):
    left = [OSError("slow down"), TimeoutError(), OSError("reset")]

    def work() -> str:
        if left:
            raise left.pop()
        return "answer"

    assert patiently(work, "s3://x") == "answer"


def test_a_store_that_goes_on_failing_is_overloaded_and_says_nothing_of_the_file(in_no_time):
    def work() -> str:
        raise OSError("slow down")

    with pytest.raises(Overloaded, match="s3://x: store error: slow down"):
        patiently(work, "s3://x")


class _WebServer(BaseHTTPRequestHandler):
    """Answers every request with the status in the path."""

    def do_GET(self) -> None:
        self.send_response(int(self.path[1:4]))
        self.send_header("Content-Length", "0")
        self.end_headers()

    do_HEAD = do_GET

    def log_message(self, *_: object) -> None:
        pass


class _WholeFiles(_WebServer):
    """Ignores which part of a file is requested, as Python's own http.server does."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Length", "700000")
        self.end_headers()
        self.wfile.write(bytes(700_000 if self.command == "GET" else 0))

    do_HEAD = do_GET


def test_a_web_server_that_sends_only_whole_files_is_told_at_once(monkeypatch: pytest.MonkeyPatch):
    """It would do so at every further try, too."""
    monkeypatch.setattr(remote_files.time, "sleep", lambda _: pytest.fail("tried again"))
    server = ThreadingHTTPServer(("127.0.0.1", 0), _WholeFiles)
    thread = Thread(target=server.serve_forever)
    thread.start()
    address = f"http://127.0.0.1:{server.server_port}/a.mcap"
    try:
        file = remote_files.open_remote(address)
        file.seek(300_000)
        with pytest.raises(NotReachable, match="sends whole files"):
            file.read(10)
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def test_a_web_server_that_fails_does_not_say_that_a_file_is_not_there(in_no_time):
    """A batch sets what is not there aside for good, and tries what failed again."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), _WebServer)
    thread = Thread(target=server.serve_forever)
    thread.start()
    address = f"http://127.0.0.1:{server.server_port}"
    try:
        for status in (404, 410, 403):
            with pytest.raises(NotReachable):
                remote_files.facts(f"{address}/{status}.mcap")
        for status in (500, 503, 429):
            with pytest.raises(Overloaded, match=str(status)):
                remote_files.facts(f"{address}/{status}.mcap")
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    with pytest.raises(Overloaded, match="Cannot connect"):
        remote_files.facts(f"{address}/a.mcap")


def test_a_chunk_that_a_store_does_not_give_is_no_damage(session, in_no_time, monkeypatch: pytest.MonkeyPatch):
    """It is requested again with the next frame; the file is not reported as damaged."""
    monkeypatch.setattr(remote_files, "BLOCK_BYTES", 16)  # so that nothing of a chunk is known yet
    source = open_source(ADDRESS)
    store = fsspec.filesystem("memory")

    def failing(*_, **__):
        raise OSError("slow down")

    with monkeypatch.context() as patch:
        patch.setattr(type(store), "cat_file", failing)
        with pytest.raises(Overloaded):
            source.frame(0)
    assert source.file.damaged == set()
    assert same(source.frame(0), SessionSource("a", str(session)).frame(0))


WRONG = {
    "nothing there": "memory://fleet/none.mcap",
    "no store of that name": "nowhere://fleet/a.mcap",
    "no session": "memory://fleet/a.bag",
}


@pytest.mark.parametrize("address", WRONG.values(), ids=WRONG)
def test_what_cannot_be_opened_is_said_in_one_line(session, in_no_time, address: str):
    with pytest.raises((SourceError, NotReachable)) as refused:
        open_source(address)
    assert str(refused.value).startswith(address)
    assert "\n" not in str(refused.value)


def test_where_folders_are_limited_only_named_addresses_are_opened(session, tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CIPV_FOLDERS", str(tmp_path))
    with pytest.raises(OSError, match="outside the allowed addresses"):
        open_remote(ADDRESS)
    monkeypatch.setenv("CIPV_ADDRESSES", "memory://fleet/ s3://other/")
    assert open_remote(ADDRESS).read(4) == b"\x89MCA"
    outside = ("memory://fleet/../secret/a.mcap", "memory://fleet/%2e%2e/secret/a.mcap", "memory://fleet/..%2Fa.mcap")
    monkeypatch.setenv("CIPV_ADDRESSES", "memory://fleet s3://other/")
    assert open_remote(ADDRESS).read(4) == b"\x89MCA"
    for address in (*outside, "memory://fleet-2/a.mcap", "memory://fleet.evil.example/a.mcap"):
        with pytest.raises(OSError, match="outside the allowed addresses"):
            open_remote(address)


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "address",
    [
        *(
            "local://{pipe}",
            "zip://a.mcap::file://{pipe}",
            "memory://a::file://{pipe}",
            "http://127.0.0.1/a::file://{pipe}",
        ),
        *("reference://a.mcap", "ftp://127.0.0.1/a.mcap", "github://a:b@c/a.mcap", "data://,a.mcap", "zip://{pipe}"),
    ],
)
def test_what_is_no_store_is_not_opened_as_one(address: str, tmp_path: Path):
    os.mkfifo(tmp_path / "a.mcap")
    with pytest.raises(NotReachable, match="not the address of a store"):
        open_source(address.format(pipe=tmp_path / "a.mcap"))


def test_without_the_extra_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    import sys

    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(NotReachable, match="`make install` installs it with the extra `fleet`"):
        open_remote(ADDRESS)
