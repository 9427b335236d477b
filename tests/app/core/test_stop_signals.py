"""Signals that end the program."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from app.core.stop_signals import as_interrupts, asked_to_stop, held_back

ROOT = Path(__file__).resolve().parents[3]


def test_a_signal_that_arrives_while_another_is_handled_is_the_same_request() -> None:
    """`timeout` and service managers send several at once; the event's lock cannot be taken twice by one thread."""
    calls = []
    with asked_to_stop() as asked:
        set_event = asked.set

        def interrupted() -> None:
            calls.append(len(calls))
            if len(calls) < 3:
                signal.raise_signal(signal.SIGTERM)
            set_event()

        asked.set = interrupted  # type: ignore[method-assign]
        signal.raise_signal(signal.SIGTERM)
        assert asked.is_set()
    assert calls == [0]


def test_only_a_second_interrupt_ends_at_once() -> None:
    with asked_to_stop() as asked:
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGTERM):
            signal.raise_signal(number)
        assert asked.is_set()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stop_that_is_held_back_comes_at_the_end(number: signal.Signals) -> None:
    steps: list[str] = []

    def start() -> None:
        with as_interrupts(), held_back():
            signal.raise_signal(number)
            steps.append("started")
        steps.append("went on")

    with pytest.raises(KeyboardInterrupt):
        start()
    assert steps == ["started"]


def test_what_starts_while_a_stop_is_held_back_is_not_interrupted() -> None:
    """A terminal sends Ctrl-C to every process. Dask starts its own from a thread."""
    program = "import signal; signal.raise_signal(signal.SIGINT); print('goes on')"
    printed: list[str] = []

    def start() -> None:
        ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
        printed.append(ended.stdout.strip())

    with held_back():
        thread = threading.Thread(target=start)
        thread.start()
    thread.join()
    assert printed == ["goes on"]


KEPT = """
import sys
from app.core.stop_signals import skip_teardown
import atexit

class Kept:
    def __del__(self):
        print("freed")

kept = Kept()
atexit.register(print, "exit handler")
if len(sys.argv) > 1:
    skip_teardown(0)
print("closed")
"""


@pytest.mark.parametrize(("arguments", "said"), [([], "closed exit handler freed"), (["skip"], "closed exit handler")])
def test_what_is_closed_is_not_torn_down(arguments: list[str], said: str) -> None:
    """That takes seconds on a busy machine; exit handlers are called, and what was printed is not lost."""
    ended = subprocess.run(
        [sys.executable, "-c", KEPT, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert ended.stdout.split() == said.split()
    assert ended.returncode == 0
