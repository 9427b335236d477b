"""Fifty pages look at one server, and one more that never reads: what each costs, and that nobody waits for anybody."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.bench.broadcast import RATE_HZ
from app.bench.clients import figures

CLIENTS, EACH_S = 50, 10.0
CHEAPER = 40.0
"""Compared with the same frames through uvicorn's default, compressed WebSocket."""
GROWTH_MS = 20.0


@pytest.mark.soak
def test_fifty_clients_are_cheap_and_none_lags_more_and_more() -> None:
    found = figures(CLIENTS, EACH_S)
    report = Path("build/soak_clients.json")
    report.parent.mkdir(exist_ok=True)
    report.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found))
    assert found["peer"]["ratio"] >= CHEAPER
    assert found["lag_ms"]["growth"] <= GROWTH_MS
    assert found["rate_hz"]["least"] >= 0.9 * RATE_HZ
