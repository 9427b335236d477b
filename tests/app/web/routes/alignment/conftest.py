"""What the tests of both fits share: a client of a server, and the end of a fit."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from app.engine.engine import Engine
from app.web.server import create_app
from tests.app.web.serving import WAIT_S, serving


@pytest.fixture
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


@pytest.fixture
def ended(client: httpx.Client) -> Callable[[str], dict[str, Any]]:
    """Waits until the fit at an address is no longer waiting or running, and returns what that address then tells."""

    def wait(address: str) -> dict[str, Any]:
        until_s = time.monotonic() + WAIT_S
        while time.monotonic() < until_s:
            now: dict[str, Any] = client.get(address).json()
            if now["state"] not in ("waiting", "running"):
                return now
        raise AssertionError(now)

    return wait
