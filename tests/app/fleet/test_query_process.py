"""Whatever a query does, it ends in time, and neither the server nor the next query notices."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from app.bench.fleet_tables import make_tables
from app.fleet import query_process
from app.fleet.desk import _AT_ONCE, FleetDesk
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from tests.app.waiting import WAIT_S, wait_until

ENDLESS = {
    "between rows": "(SELECT sum(a.range * b.range) FROM range(10000000) a, range(10000000) b) > 0",
    "within a function": "levenshtein(repeat(drive, 1000000), repeat(kind, 1000000)) > 1",
    "while it is planned": "length(repeat('a', 2000000000)) > 1",
}


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fleet")
    make_tables(folder, 2)
    return folder


@pytest.fixture
def desk(out: Path) -> Iterator[FleetDesk]:
    desk = FleetDesk(str(out))
    yield desk
    desk.close()


@pytest.mark.parametrize("where", ENDLESS.values(), ids=ENDLESS)
def test_a_query_without_end_is_stopped_wherever_it_is_and_the_next_one_is_answered(
    desk: FleetDesk, where: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(query_process, "_KILLED_AFTER_S", 0.2)
    desk.most_s = 0.2
    with pytest.raises(BadInput, match=r"0\.2 s|allocate"):
        desk.find(None, where, "events", 1)
    desk.most_s = WAIT_S
    assert desk.find(None, "", "drives", 1)[1].total == 2


def test_queries_use_one_process_which_ends_with_the_desk(desk: FleetDesk) -> None:
    desk.find(None, "", "drives", 1)
    process = desk._process._process
    assert process is not None
    desk.counts(None, "", "events", "kind")
    assert desk._process._process is process
    desk.close()
    assert process.returncode is not None


def test_a_server_that_is_killed_leaves_no_process_behind(out: Path, desk: FleetDesk) -> None:
    """Its end of the pipe closes."""
    desk.most_s = WAIT_S
    with ThreadPoolExecutor(1) as asking:
        answer = asking.submit(desk.find, None, ENDLESS["within a function"], "events", 1)
        assert wait_until(lambda: desk._process._process is not None)
        process = desk._process._process
        assert process is not None
        assert process.stdin is not None
        process.stdin.close()
        process.wait(WAIT_S)
        with pytest.raises((BadInput, Overloaded)):
            answer.result(WAIT_S)


def test_too_many_at_once_are_refused(desk: FleetDesk, monkeypatch: pytest.MonkeyPatch) -> None:
    begun, goes_on, ask = threading.Semaphore(0), threading.Event(), desk._process.ask

    def slow(*asked: Any) -> Any:
        begun.release()
        goes_on.wait(WAIT_S)
        return ask(*asked)

    monkeypatch.setattr(desk._process, "ask", slow)
    with ThreadPoolExecutor(_AT_ONCE) as threads:
        answers = [threads.submit(desk.find, None, "", "drives", 1) for _ in range(_AT_ONCE)]
        assert begun.acquire(timeout=WAIT_S)
        assert wait_until(lambda: desk._waiting._value == 0)
        with pytest.raises(Overloaded, match="too many searches"):
            desk.find(None, "", "drives", 1)
        goes_on.set()
        assert {answer.result(WAIT_S)[1].total for answer in answers} == {2}


def test_a_process_that_died_is_replaced(desk: FleetDesk) -> None:
    desk.find(None, "", "drives", 1)
    process = desk._process._process
    assert isinstance(process, subprocess.Popen)
    process.kill()
    process.wait()
    assert desk.find(None, "", "drives", 1)[1].total == 2
