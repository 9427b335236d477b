"""What one more client of the stream costs, and what the clients of a real server get."""

from __future__ import annotations

import pytest

from app.bench.broadcast import RATE_HZ
from app.bench.clients import Client, ClientRun, _lags, _measure, _per_frame_ms, _rate_hz, _server
from tests.app.waiting import loop_apart


def run_of(*lags_s: list[float], cpu_s: float = 1.0, spent_s: float = 10.0) -> ClientRun:
    return ClientRun([Client(each) for each in lags_s], cpu_s, spent_s)


def test_making_a_frame_is_no_cost_of_a_client():
    one = run_of([0.01] * 100, cpu_s=0.5)
    many = run_of(*[[0.01] * 100 for _ in range(51)], cpu_s=0.5 + 50 * 100 * 2e-4)
    assert _per_frame_ms(one, many) == pytest.approx(0.2)


def test_runs_of_different_length_are_made_comparable():
    one = run_of([0.01] * 50, cpu_s=0.25, spent_s=5.0)
    many = run_of(*[[0.01] * 100 for _ in range(11)], cpu_s=0.5 + 10 * 100 * 1e-3)
    assert _per_frame_ms(one, many) == pytest.approx(1.0)


def test_a_lag_that_grows_at_one_client_shows_whatever_the_others_do():
    steady, growing = [0.02] * 90, [0.02 + 0.001 * n for n in range(90)]
    assert _lags(run_of(steady, steady))["growth"] == 0.0
    assert _lags(run_of(steady, growing))["growth"] == pytest.approx(60.0, abs=1.0)
    assert _rate_hz(run_of(steady, growing[:45])) == {"least": 4.5, "most": 9.0, "of": RATE_HZ}


def test_real_clients_are_served_beside_one_that_does_not_read(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("app.bench.clients._SETTLE_S", 0.5)
    with _server(deflate=False) as server, loop_apart() as run_to_end:
        run = run_to_end(_measure(server, 3, 1.0, None))
    assert len(run.clients) == 3
    assert all(client.lags_s for client in run.clients)
    assert all(lag > 0 for client in run.clients for lag in client.lags_s)
    assert run.cpu_s > 0
