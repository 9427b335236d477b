"""Measures page latency in a real browser: from the creation of a result to the painted frame, the cost of painting,
and how soon a changed parameter appears in the stream during playback."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.request import Request

import numpy as np
from websockets.sync.client import connect

from app.bench.page.browser import Waits, first_views_ms, paused, playing
from app.bench.page.devtools import FLAGS, Browser, browser
from app.bench.page.labelled import labelled
from app.core.local_requests import open_local
from pipeline.common.errors import BadInput

_ALL_SEEN_WITHIN_S, _ASK_EVERY_S = 120.0, 0.5
_SETTLE_BRIEFLY_S = 1.0
_PARAMETER_EVERY_S = 0.23
_PARAMETER_VALUES = (0.65, 0.75)
_SERVER = """
import sys
from pathlib import Path
from app.core import session_folder
session_folder.SESSIONS = Path(sys.argv.pop(1))
from app.cli import main
sys.exit(main())
"""
"""The command line with its own folder of sessions: it leaves the user's labels and settings alone, and knows no
detections of earlier starts."""
_REVISION = re.compile(rb'"params_revision":([0-9]+)')


def figures(source: str, for_s: float) -> dict[str, Any]:
    """All figures, in milliseconds. BadInput without a browser.

    ``page``: latency from result to paint and CPU time per frame by kind of process; while paused, latency from a seek
    and from a slider move to the paint, and from a seek with 100,000 labels in labeling mode; time from opening the
    address to the first painted frame. ``while_computed``: the same while the whole drive is computed for the first
    time, with networks. ``parameter``: during playback, time from the request to the first message with its result.
    """
    with browser() as running:
        with _dashboard(source) as address:
            live = _playing(running, address, for_s)
            parameter = _parameter(address, for_s)
            page = {**live, **_still(running, address)}
        with _dashboard(source) as address:
            computed = _while_computed(running, address)
        return {"source": source, "page": page, "while_computed": computed, "parameter": parameter}


@contextmanager
def _dashboard(source: str) -> Iterator[str]:
    """The address of a dashboard that plays a recording, in its own process."""
    folder = tempfile.TemporaryDirectory(prefix="cipv-bench-")
    labels = f"sqlite:///{folder.name}/labels.db"
    command = [sys.executable, "-c", _SERVER, folder.name, "serve", source, "--port", "0", "--labels", labels]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        address = next((line.strip() for line in process.stdout if line.startswith("http")), None)
        if address is None:
            raise BadInput(f"{source} cannot be served")
        _wait_until_it_plays(address)
        yield address
    finally:
        process.terminate()
        process.communicate()
        folder.cleanup()


def _wait_until_it_plays(address: str) -> None:
    with connect(_stream(address), max_size=None, proxy=None) as socket:
        for message in socket:
            if isinstance(message, bytes):
                return


def _stream(address: str) -> str:
    return address.replace("http", "ws") + "/api/stream"


def _playing(running: Browser, address: str, for_s: float) -> dict[str, Any]:
    painted_ms, rate_hz, cpu = playing(running, address, for_s)
    return {
        **_spread(painted_ms),
        "frames": len(painted_ms),
        "rate_hz": round(rate_hz, 1),
        "cpu_ms_per_frame": {"all": round(sum(cpu.values()), 1), **{k: v for k, v in cpu.items() if v >= 1.0}},
        "browser_flags": " ".join(FLAGS),
    }


def _still(running: Browser, address: str) -> dict[str, Any]:
    count = _paused_with_all_seen(address)
    seeks, slides = paused(running, address, count)
    first_ms = first_views_ms(running, address)
    with_labels = {what: _spread(waits_ms) for what, waits_ms in labelled(running, address, count).items()}
    return {
        "seek": _waits(seeks),
        "slider": _waits(slides),
        "first_view": _spread(first_ms),
        "seek_with_100000_labels": with_labels,
    }


def _while_computed(running: Browser, address: str) -> dict[str, Any]:
    """Figures while the whole drive is being computed. frames_hz: frames computed per second. to_the_end: whether the
    computation lasted for the whole measurement; a short drive finishes earlier."""
    _post(address, "POST", "/api/playback", {"playing": False})
    before, start = _state(address), time.monotonic()
    seeks, slides = paused(running, address, int(before["count"]), _SETTLE_BRIEFLY_S)
    first_ms = first_views_ms(running, address)
    after, spent_s = _state(address), time.monotonic() - start
    return {
        "seek": _waits(seeks),
        "slider": _waits(slides),
        "first_view": _spread(first_ms),
        "frames_hz": round((after["drive"]["done"] - before["drive"]["done"]) / spent_s, 1),
        "to_the_end": after["drive"]["running"],
    }


def _waits(waits: list[Waits]) -> dict[str, Any]:
    """Figures of the delays until the frame is painted, and until the whole page is: table, reasons and parameters
    follow the frame."""
    whole = _spread([each.whole_ms for each in waits])
    return {**_spread([each.painted_ms for each in waits]), "whole": whole}


def _paused_with_all_seen(address: str) -> int:
    """Pause once the networks have processed every frame, as when a user waits for the timeline. Returns the number of
    frames."""
    deadline = time.monotonic() + _ALL_SEEN_WITHIN_S
    while time.monotonic() < deadline:
        if not _state(address)["drive"]["running"]:
            break
        time.sleep(_ASK_EVERY_S)
    _post(address, "POST", "/api/playback", {"playing": False})
    return int(_state(address)["count"])


def _state(address: str) -> Any:
    with open_local(f"{address}/api/state") as answer:
        return json.load(answer)


def _parameter(address: str, for_s: float) -> dict[str, Any]:
    """Figures for changing one parameter back and forth during playback."""
    waits_ms: list[float] = []
    with connect(_stream(address), max_size=None, compression=None, proxy=None) as socket:
        end = time.monotonic() + for_s
        while time.monotonic() < end:
            value = _PARAMETER_VALUES[len(waits_ms) % 2]
            start = time.monotonic()
            revision = _change(address, {"cluster.tolerance_m": value})
            for message in socket:
                if isinstance(message, bytes) and _revision_of(message) >= revision:
                    break
            waits_ms.append((time.monotonic() - start) * 1e3)
            time.sleep(_PARAMETER_EVERY_S)
            _drop_waiting(socket)
    return {**_spread(waits_ms), "changes": len(waits_ms)}


def _change(address: str, changes: dict[str, float]) -> int:
    return int(_post(address, "PATCH", "/api/params", {"changes": changes, "final": False})["revision"])


def _post(address: str, method: str, path: str, body: dict[str, Any]) -> Any:
    request = Request(address + path, json.dumps(body).encode(), {"content-type": "application/json"}, method=method)
    with open_local(request) as answer:
        return json.load(answer)


def _revision_of(message: bytes) -> int:
    found = _REVISION.search(message)
    return int(found[1]) if found else -1


def _drop_waiting(socket: Any) -> None:
    """Discard messages that arrived while nobody was waiting for them."""
    while True:
        try:
            socket.recv(timeout=0)
        except TimeoutError:
            return


def _spread(values_ms: list[float]) -> dict[str, float | None]:
    if not values_ms:
        return {"median_ms": None, "p95_ms": None}
    return {
        "median_ms": round(float(np.median(values_ms)), 1),
        "p95_ms": round(float(np.percentile(values_ms, 95)), 1),
    }
