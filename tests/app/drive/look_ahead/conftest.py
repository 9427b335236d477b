"""The look-ahead process of these tests runs at the usual priority: at idle priority, a busy machine starves it."""

from __future__ import annotations

import pytest

from app.drive.look_ahead import client
from tests.app.drive.look_ahead.networks import COMMAND


@pytest.fixture(autouse=True)
def _at_usual_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "_COMMAND", COMMAND)
