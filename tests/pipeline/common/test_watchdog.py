"""An operation that takes longer than ever is reported; habitual slowness, waiting and a suspended machine are not."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.common.watchdog import Retired, Stuck, Watchdog, at_work, is_stopped, process_waited_s, waited_s
from tests.app.waiting import wait_until


@pytest.fixture(autouse=True)
def _idle_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.common.watchdog.os.getloadavg", lambda: (0.0, 0.0, 0.0))
    monkeypatch.setattr("pipeline.common.watchdog.os.cpu_count", lambda: 2)


def test_on_a_busy_machine_everything_may_take_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.common.watchdog.os.getloadavg", lambda: (10.0, 4.0, 1.0))
    assert Watchdog(first_s=30.0).allowed_s("the network") == pytest.approx(150.0)


def worked(watchdog: Watchdog, doing: str, took_s: list[float], monkeypatch: pytest.MonkeyPatch) -> None:
    """Each job began and ended, on a clock set by the test."""
    for took in took_s:
        with monkeypatch.context() as patch:
            times = iter([0.0, took])
            patch.setattr("pipeline.common.watchdog.time.monotonic", lambda times=times: next(times))
            with at_work(doing):
                pass


def told_of(watchdog: Watchdog, *times_s: float) -> list[list[str]]:
    """The operations that are told as stuck at each of these times.

    Compare them after the block of ``watching``, which lets no error of a retired worker through, not even that of an
    assertion."""
    return [[stuck.doing for stuck in watchdog.look(at_s)] for at_s in times_s]


def _work_too_long(watchdog: Watchdog, told: list[list[str]]) -> None:
    now_s = time.monotonic()
    with at_work("the network"):
        told += told_of(watchdog, now_s + 1.6, time.monotonic() + 1.9, now_s + 9.0)


def test_a_call_may_take_its_worst_time_and_the_patience_more(monkeypatch: pytest.MonkeyPatch) -> None:
    watchdog, told, by_time = Watchdog(patience_s=1.0, first_s=30.0), list[Stuck](), list[list[str]]()
    with watchdog.watching("a worker", told.append):
        assert watchdog.allowed_s("the network") == 30.0
        worked(watchdog, "the network", [0.2] * 19 + [0.7], monkeypatch)
        assert watchdog.allowed_s("the network") == pytest.approx(1.7)
        with pytest.raises(Retired):
            _work_too_long(watchdog, by_time)
    assert by_time == [[], ["the network"], []], "told once"
    (stuck,) = told
    assert (stuck.worker, stuck.doing) == ("a worker", "the network")
    assert stuck.thread_id == threading.get_ident()


def test_what_is_known_to_be_fast_is_not_given_the_time_of_a_first_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Until its usual time is known, and not for what it is a part of."""
    watchdog, told, before_s = Watchdog(first_s=30.0), list[Stuck](), time.monotonic()
    with watchdog.watching("the recorder", told.append, retires=False), at_work("saving a chunk"):
        with at_work("syncing to the disk", first_s=5.0):
            assert watchdog.look(before_s + 4.9) == []
            assert [stuck.doing for stuck in watchdog.look(time.monotonic() + 6.0)] == ["syncing to the disk"]
        assert watchdog.look(before_s + 29.0) == []
        worked(watchdog, "syncing to the disk", [8.0] * 20, monkeypatch)
        assert watchdog.allowed_s("syncing to the disk", first_s=5.0) == pytest.approx(9.0)


def test_what_took_long_on_a_busy_machine_is_not_extended_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six times more programs than processors, before and after; then twice as many, and none."""
    load = [12.0]
    monkeypatch.setattr("pipeline.common.watchdog.os.getloadavg", lambda: (load[-1], 0.0, 0.0))
    watchdog = Watchdog(patience_s=1.0, first_s=30.0)
    with watchdog.watching("a worker", lambda stuck: None):
        worked(watchdog, "the network", [1.5] * 20, monkeypatch)
        assert watchdog.allowed_s("the network") == pytest.approx(1.5 + 6.0)
        load.append(24.0)
        assert watchdog.allowed_s("the network") == pytest.approx(3.0 + 12.0)
        load.append(0.0)
        assert watchdog.allowed_s("the network") == pytest.approx(1.5 + 1.0)


def test_time_in_which_the_machine_did_not_let_it_run_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    watchdog, waited_s, told = Watchdog(first_s=1.0), [5.0], list[list[str]]()
    monkeypatch.setattr("pipeline.common.watchdog.waited_s", lambda native_id: waited_s[-1])
    with watchdog.watching("a worker", lambda stuck: None):
        assert watchdog.look(time.monotonic()) == []
        with pytest.raises(Retired):
            _starved(watchdog, waited_s, told)
    assert told == [[], ["reading"]], "3 of the 3.5 s it waited for a processor"


def _starved(watchdog: Watchdog, waited_s: list[float], told: list[list[str]]) -> None:
    before_s = time.monotonic()
    with at_work("reading"):
        waited_s.append(8.0)
        told += told_of(watchdog, before_s + 3.5, time.monotonic() + 4.5)


def test_the_system_tells_how_long_a_thread_waited_for_a_processor() -> None:
    if not Path("/proc/self/schedstat").exists():
        pytest.skip("only Linux tells")
    waited = waited_s(threading.get_native_id())
    assert waited is not None
    assert 0.0 <= waited < 3600.0
    assert waited_s(2**30) is None


def test_who_waits_for_work_does_not_hang_nor_who_was_asleep_with_the_machine() -> None:
    watchdog, before_s, asleep_s = Watchdog(first_s=1.0), time.monotonic(), 3600.0
    with watchdog.watching("a worker", lambda stuck: None):
        told = watchdog.look(time.monotonic() + 1e6)
        with at_work("reading"):
            told += watchdog.look(before_s + asleep_s, late_s=asleep_s)
    assert told == []


def test_what_is_done_within_something_else_counts_for_itself() -> None:
    watchdog, before_s = Watchdog(first_s=5.0), time.monotonic()
    with watchdog.watching("a worker", lambda stuck: None), at_work("the pipeline"):
        with at_work("the network"):
            pass
        told = watchdog.look(before_s + 4.0)
        with at_work("the network"):
            told += watchdog.look(before_s + 4.0)
    assert told == []


def test_a_thread_that_nobody_watches_may_say_what_it_likes() -> None:
    with at_work("anything"):
        pass


def test_who_waits_for_a_process_is_given_the_time_of_a_first_run_and_the_processs_own_waiting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waits_s = iter((3.0, 3.0, 11.0, 11.0))
    monkeypatch.setattr("pipeline.common.watchdog.process_waited_s", lambda process: next(waits_s))
    watchdog, told = Watchdog(first_s=30.0), list[list[str]]()
    monkeypatch.setattr("pipeline.common.watchdog.busy_share", lambda: 0.0)
    with watchdog.watching("a worker", lambda stuck: None):
        for _ in range(30):
            with at_work("looking"):
                pass
        with pytest.raises(Retired):
            _waits_for_a_process(watchdog, told)
    assert told[:2] == [[], []], "the usual time of the operation does not count"
    assert told[2:] == [[], ["looking"]], "8 of the 37 s it waited for a processor"


def _waits_for_a_process(watchdog: Watchdog, told: list[list[str]]) -> None:
    start_s = time.monotonic()
    with at_work("looking", 4711):
        told += told_of(watchdog, start_s, start_s + 29.0, start_s + 37.0, time.monotonic() + 39.0)


def test_the_system_tells_how_long_a_process_waited_for_a_processor() -> None:
    if not Path("/proc/self/schedstat").exists():
        pytest.skip("only Linux tells")
    waited = process_waited_s(os.getpid())
    assert waited is not None
    assert waited >= 0.0
    assert process_waited_s(2**30) is None


@pytest.fixture
def process() -> Iterator[subprocess.Popen[bytes]]:
    """A process that waits."""
    with subprocess.Popen((sys.executable, "-c", "input()"), stdin=subprocess.PIPE) as process:
        yield process
        process.kill()


def test_a_process_that_is_stopped_is_noticed_after_the_patience(process: subprocess.Popen[bytes]) -> None:
    if not Path("/proc/self/stat").exists():
        pytest.skip("only Linux tells")
    watchdog, told = Watchdog(patience_s=1.0, first_s=1e6), list[list[str]]()
    with watchdog.watching("a worker", lambda stuck: None), pytest.raises(Retired):
        _waits_for_one_that_is_stopped(watchdog, process, told)
    assert told[:1] == [[]], "it runs"
    assert told[1:4] == [[], [], []], "this program was stopped with it"
    assert told[4:] == [[], ["looking"]]


def _waits_for_one_that_is_stopped(watchdog: Watchdog, process: subprocess.Popen[bytes], told: list[list[str]]) -> None:
    with at_work("looking", process.pid):
        now_s = time.monotonic()
        told += told_of(watchdog, now_s + 100.0)
        process.send_signal(signal.SIGSTOP)
        assert wait_until(lambda: is_stopped(process.pid))
        told += told_of(watchdog, now_s + 200.0, now_s + 200.9)
        told.append([stuck.doing for stuck in watchdog.look(now_s + 300.0, late_s=99.0)])
        told += told_of(watchdog, now_s + 300.9, now_s + 301.1)


def test_a_process_that_goes_on_in_time_is_not_stuck(process: subprocess.Popen[bytes]) -> None:
    if not Path("/proc/self/stat").exists():
        pytest.skip("only Linux tells")
    watchdog = Watchdog(patience_s=1.0, first_s=1e6)
    with watchdog.watching("a worker", lambda stuck: None), at_work("looking", process.pid):
        now_s = time.monotonic()
        process.send_signal(signal.SIGSTOP)
        assert wait_until(lambda: is_stopped(process.pid))
        told = watchdog.look(now_s)
        process.send_signal(signal.SIGCONT)
        assert wait_until(lambda: not is_stopped(process.pid))
        told += watchdog.look(now_s + 5.0)
        process.send_signal(signal.SIGSTOP)
        assert wait_until(lambda: is_stopped(process.pid))
        told += watchdog.look(now_s + 5.5)
    assert told == []


def test_a_process_that_ended_counts_as_stopped_and_one_that_never_was_does_not(
    process: subprocess.Popen[bytes],
) -> None:
    if not Path("/proc/self/stat").exists():
        pytest.skip("only Linux tells")
    process.kill()
    assert wait_until(lambda: is_stopped(process.pid)), "its parent has not asked for its status yet"
    assert not is_stopped(2**30)


def test_a_worker_that_is_not_retired_is_told_once_per_operation_and_goes_on() -> None:
    watchdog, told = Watchdog(first_s=1.0), list[Stuck]()
    with watchdog.watching("the recorder", told.append, retires=False):
        for _ in range(2):
            with at_work("writing"):
                later_s = time.monotonic() + 5.0
                watchdog.look(later_s)
                watchdog.look(later_s + 1.0)
    assert [each.doing for each in told] == ["writing", "writing"]
