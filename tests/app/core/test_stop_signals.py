"""Signals that end the program."""

from __future__ import annotations

import signal

import pytest

from app.core.stop_signals import asked_to_stop


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
