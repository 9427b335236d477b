"""Killing the server while somebody labels: what it answered must be there afterwards, and whole."""

from __future__ import annotations

import random
import threading
from pathlib import Path

import httpx
from sqlalchemy import select

from app.labels.store.database import Database
from app.labels.store.drive_labels import DriveLabels
from app.labels.store.tables import DriveRow
from tests.app.labels.conftest import info
from tests.app.labels.server_process import forking, started
from tests.app.web.serving import WAIT_S

CUBOID = {"center": [20.0, 0.0, 0.7], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.0}
_LONGEST_S = 0.05
_MOST_BEFORE = 12
"""The random moment depends on the number of answers and on time: on a slow machine, no fixed time guarantees an
answer."""


def kill_again_and_again(file: Path, kills: int, seed: int) -> tuple[int, int]:
    """(number of acts confirmed, number of those lost or half done). Each server is killed at a random moment."""
    chance, answered, lost = random.Random(seed), 0, 0
    with forking() as context:
        for turn in range(kills):
            process, address = started(context, file)
            killer = threading.Timer(chance.uniform(0.0, _LONGEST_S), process.kill)
            said = _label_until_it_dies(address, turn, killer, chance.randint(1, _MOST_BEFORE))
            process.join(WAIT_S)
            answered += len(said)
            lost += _lost(file, said)
    return answered, lost


def _label_until_it_dies(address: str, turn: int, killer: threading.Timer, after: int) -> list[tuple[int, int]]:
    """Act and frame of each answer. Every act creates its own track. The killer starts after some answers."""
    said: list[tuple[int, int]] = []
    with httpx.Client(base_url=address, timeout=WAIT_S) as client:
        drive = client.get("/api/labels").json()["drive"]["id"]
        while True:
            if len(said) == after:
                killer.start()
            frame = len(said) % 30
            body = {"kind": "add_track", "label": f"car {turn} {len(said)}", "frame": frame, "cuboid": CUBOID}
            try:
                answer = client.post("/api/labels/act", json={"person": "Ada", "act": body, "drive": drive})
            except httpx.TransportError:
                killer.join()
                return said
            assert answer.status_code == 200, answer.text
            said.append((answer.json()["act"], frame))


def _lost(file: Path, said: list[tuple[int, int]]) -> int:
    """Acts whose row, track or sighting is missing. The database itself must be intact."""
    database = Database.in_file(file)
    try:
        with database.reading() as connection:
            assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
            key = connection.scalars(select(DriveRow.key)).one()
        labels = DriveLabels(database, info(key, count=30))
        changes = labels.changes()
        assert changes.revision == len(changes.items)
        made = {item.revision: changes.extents[item.id][0] for item in changes.items}
        return sum(made.get(act) != frame for act, frame in said)
    finally:
        database.close()
