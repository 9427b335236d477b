"""Everything at once, at random: servers, recorders and databases are killed, disks and descriptors run out, clocks
jump, live sensors fail and are flooded, clients misbehave, other programs take the machine. No act is lost, no gap is
unsaid, no final frame is wrong, every sensor comes back, and memory stays. Looked at once a minute.

``CIPV_CHAOS_SECONDS`` is how long, an hour by default. Writes build/soak_chaos.json. How soon each sensor comes back
after each fault on a quiet machine is in ``test_live.py``.
"""

from __future__ import annotations

import json
import os
import random
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.app.labels import postgres
from tests.app.labels.server_process import forking
from tests.conftest import ROOT
from tests.soak.chaos.clients import deaf, half_open, pressure
from tests.soak.chaos.figures import Figures
from tests.soak.chaos.live import LiveCar
from tests.soak.chaos.recorder import record
from tests.soak.chaos.server import LabelledServer, session

SECONDS = float(os.environ.get("CIPV_CHAOS_SECONDS", "3600"))
CHECK_EVERY_S = 60.0
GROWN_MB = 50.0
"""Range of the server's resident size over all checks, ten times that of an hour on an overloaded machine; and how much
larger than at the first check that of the recorder of live sensors may become."""


@pytest.mark.soak
@pytest.mark.timeout(7200)
def test_chaos(tmp_path: Path) -> None:
    seed = int(os.environ.get("CIPV_CHAOS_SEED", str(time.time_ns())))
    figures, chance, stop = Figures(), random.Random(seed), threading.Event()
    with ExitStack() as stack:
        context, found = stack.enter_context(forking()), postgres.binaries()
        url = f"sqlite:///{tmp_path}/labels.db" if found is None else stack.enter_context(postgres.running(found))
        server = LabelledServer(context, url, session(tmp_path / "drive.mcap"), figures)
        stack.callback(lambda: server.process.kill())  # of this moment, as its address
        car = LiveCar(tmp_path / "live", chance, figures)
        car.lend_clock(stack.enter_context(pytest.MonkeyPatch.context()))
        works = [
            partial(car.drive, stop),
            partial(server.label, stop),
            partial(half_open, server, stop),
            partial(deaf, server, stop),
        ]
        threads = [threading.Thread(target=work) for work in works]
        server.check()
        for thread in threads:
            thread.start()
            stack.callback(thread.join)
        stack.callback(stop.set)
        car.begin()
        _disturb(server, car, tmp_path, chance, partial(_report, seed, url, figures))
        car.end()
    report = _report(seed, url, figures)
    print(json.dumps(report))
    assert figures.wrong == []
    assert figures.acts > 0
    assert figures.live_frames > 0
    assert report["grown_MB"] < GROWN_MB
    assert report["live_grown_MB"] < GROWN_MB


def _report(seed: int, url: str, figures: Figures) -> dict[str, Any]:
    """Write what has happened so far."""
    resident, live = figures.resident_mb, figures.live_resident_mb
    report = {"seconds": SECONDS, "seed": seed, "database": url.partition(":")[0]}
    report |= {"grown_MB": max(resident) - min(resident), "live_grown_MB": max(live) - live[0]}
    report |= vars(figures)
    (ROOT / "build").mkdir(exist_ok=True)
    (ROOT / "build" / "soak_chaos.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return report


def _disturb(
    server: LabelledServer, car: LiveCar, folder: Path, chance: random.Random, report: Callable[[], object]
) -> None:
    kinds: dict[str, Callable[[], None]] = {
        "server killed": server.kill,
        "server frozen": server.freeze,
        "clock set": server.set_clock,
        "descriptors used up": server.use_up_descriptors,
        "memory used up": server.use_up_memory,
        "database killed": server.kill_database,
        "database's disk full": server.fill_disk,
        "car switched off": car.switch_off,
        "recorder's clock set": car.set_clock,
        "sensor ports flooded": car.flood,
    }
    ends_s = time.monotonic() + SECONDS
    checked_s = time.monotonic()
    while time.monotonic() < ends_s:
        with pressure() if chance.random() < 0.3 else ExitStack():
            kind = chance.choice([*kinds, "recorder"])
            if kind == "recorder":
                record(folder, chance, server.figures)
            else:
                kinds[kind]()
                server.figures.befell[kind] += 1
            time.sleep(chance.uniform(0.2, 2.0))
        if time.monotonic() - checked_s >= min(CHECK_EVERY_S, SECONDS / 3):
            server.check()
            car.check()
            report()
            checked_s = time.monotonic()
    server.check()
    car.check()
