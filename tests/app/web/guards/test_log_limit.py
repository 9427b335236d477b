"""Clients cannot fill the log."""

from __future__ import annotations

import asyncio
import logging

import pytest

from app.web.guards import log_limit
from app.web.guards.log_limit import OncePerPeriod, limit_logs
from app.web.server import create_app
from tests.app.web.guards.test_connections import half_open, hangs_up
from tests.app.web.serving import running, serving


def record(text: str) -> logging.LogRecord:
    return logging.LogRecord("asyncio", logging.ERROR, "", 0, text, None, None)


def test_a_line_is_logged_once_in_its_period_and_again_after_it(monkeypatch: pytest.MonkeyPatch) -> None:
    limit = OncePerPeriod()
    assert [limit.filter(record(text)) for text in ("a", "a", "b", "a")] == [True, False, True, False]
    monkeypatch.setattr(log_limit, "PERIOD_S", 0.0)
    assert limit.filter(record("a"))


def test_many_different_lines_are_limited_too() -> None:
    limit = OncePerPeriod()
    assert sum(limit.filter(record(str(number))) for number in range(10_000)) == 200


def test_a_request_that_ends_with_the_server_is_no_error() -> None:
    cancelled = asyncio.CancelledError("Task cancelled, timeout graceful shutdown exceeded")
    ended = logging.LogRecord(
        "uvicorn.error", logging.ERROR, "", 0, "Exception in ASGI application", None, (type(cancelled), cancelled, None)
    )
    assert not OncePerPeriod().filter(ended)


def test_requests_that_are_none_are_logged_once(capfd: pytest.CaptureFixture[str]) -> None:
    log_limit._ONCE._said_s.clear()
    with running() as engine, serving(create_app(engine)) as address:
        for _ in range(20):
            with half_open(address, b"\x00 not HTTP\r\n\r\n") as client:
                while not hangs_up(client):
                    pass
    assert capfd.readouterr().err.count("Invalid HTTP request") == 1


def test_libraries_without_a_handler_are_limited_too() -> None:
    limit_logs()
    assert logging.lastResort is not None
    failed = logging.LogRecord("websockets.server", logging.ERROR, "", 0, "connection handler failed", None, None)
    assert [bool(logging.lastResort.filter(failed)) for _ in range(3)] == [True, False, False]
