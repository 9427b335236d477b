"""Benchmarks stream clients: what each costs the server compared with uvicorn's default compressed WebSocket, and
whether a client that never reads makes others lag."""

from __future__ import annotations

import asyncio
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect

from app.bench.broadcast import RATE_HZ

_MADE = re.compile(rb'"made_unix_ms":([0-9.]+)')
_HEAD_BYTES = 200
_SETTLE_S = 1.0
_OPEN_TIMEOUT_S = 30.0


@dataclass
class Client:
    """What one client of the stream received."""

    lags_s: list[float] = field(default_factory=list)
    """From the creation of each frame to its arrival here."""


@dataclass(frozen=True)
class ClientRun:
    """What the clients received, and the server's CPU time for it."""

    clients: list[Client]
    """One entry per connection."""
    cpu_s: float
    """CPU time of the server's process, seconds."""
    spent_s: float
    """Wall-clock time of the measurement."""

    @property
    def frames(self) -> int:
        return sum(len(client.lags_s) for client in self.clients)


def figures(clients: int, each_s: float) -> dict[str, Any]:
    """CPU time in ms per client and frame, with and without compression, each from the difference between one client
    and ``clients``; lags and rates without compression, next to a client that never reads. Each of the four runs takes
    ``each_s``."""
    with _server(deflate=False) as plain, _server(deflate=True) as compressed:
        runs = {
            (name, number): asyncio.run(_measure(server, number, each_s, compression))
            for number in (1, clients)
            for name, server, compression in (("ours", plain, None), ("default", compressed, "deflate"))
        }
    ours = _per_frame_ms(runs["ours", 1], runs["ours", clients])
    peer = _per_frame_ms(runs["default", 1], runs["default", clients])
    many, peers = runs["ours", clients], runs["default", clients]
    return {
        "clients": clients,
        "cpu_ms_per_client_frame": round(ours, 4),
        "peer": {"cpu_ms_per_client_frame": round(peer, 4), "ratio": round(peer / ours, 1), "rate_hz": _rate_hz(peers)},
        "rate_hz": _rate_hz(many),
        "lag_ms": _lags(many),
    }


def _per_frame_ms(one: ClientRun, many: ClientRun) -> float:
    """CPU time that one more client costs per frame. A frame is encoded once, however many clients there are."""
    made = one.cpu_s / one.spent_s
    sent_s = many.cpu_s - made * many.spent_s
    return 1e3 * max(sent_s, 1e-9) / max(1, many.frames - round(one.frames * many.spent_s / one.spent_s))


def _rate_hz(run: ClientRun) -> dict[str, float]:
    """Frames per second of the fastest and of the slowest client."""
    rates = [len(client.lags_s) / run.spent_s for client in run.clients]
    return {"least": round(min(rates), 1), "most": round(max(rates), 1), "of": RATE_HZ}


def _lags(run: ClientRun) -> dict[str, float]:
    """Lags over all clients, in ms. ``growth`` is the change of the median from the first to the last third of the run,
    for the client whose median changed most."""
    every = np.concatenate([client.lags_s for client in run.clients]) * 1e3
    growth = []
    for client in run.clients:
        third = max(1, len(client.lags_s) // 3)
        growth.append(1e3 * float(np.median(client.lags_s[-third:]) - np.median(client.lags_s[:third])))
    median, p99 = np.median(every), np.percentile(every, 99)
    return {"median": round(float(median), 1), "p99": round(float(p99), 1), "growth": round(max(growth), 1)}


@dataclass
class _Server:
    port: int
    process: subprocess.Popen[str]

    def cpu_s(self) -> float:
        """CPU time of the server's process so far."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        return float(self.process.stdout.readline())


@contextmanager
def _server(*, deflate: bool) -> Iterator[_Server]:
    command = [sys.executable, "-m", "app.bench.broadcast", *(["--deflate"] if deflate else [])]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield _Server(int(process.stdout.readline()), process)
    finally:
        process.kill()
        process.communicate()


async def _measure(server: _Server, number: int, for_s: float, compression: str | None) -> ClientRun:
    """Run ``number`` clients that read and, if there are several, one more that does not."""
    url, lazy = f"ws://127.0.0.1:{server.port}/", int(number > 1)
    sockets = await asyncio.gather(*(_open(url, compression) for _ in range(number + lazy)))
    clients = [Client() for _ in range(number)]
    readers = [asyncio.create_task(_read(*pair)) for pair in zip(sockets, clients, strict=False)]
    await asyncio.sleep(_SETTLE_S)
    for client in clients:
        client.lags_s.clear()
    cpu_s, start = await asyncio.to_thread(server.cpu_s), time.monotonic()
    await asyncio.sleep(for_s)
    cpu_s = await asyncio.to_thread(server.cpu_s) - cpu_s
    spent_s = time.monotonic() - start
    for reader in readers:
        reader.cancel()
    run = ClientRun([Client(list(client.lags_s)) for client in clients], cpu_s, spent_s)
    for socket in sockets:
        socket.transport.abort()
    return run


async def _open(url: str, compression: str | None) -> ClientConnection:
    return await connect(
        url,
        max_size=None,
        compression=compression,
        open_timeout=_OPEN_TIMEOUT_S,
        max_queue=2,
        ping_interval=None,
        proxy=None,
    )


async def _read(socket: ClientConnection, client: Client) -> None:
    async for message in socket:
        made = _MADE.search(message[:_HEAD_BYTES]) if isinstance(message, bytes) else None
        if made is not None:
            client.lags_s.append(time.time() - float(made[1]) / 1e3)
