"""Packing holds a few parts at once, however many drives a pack has."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

import pyarrow as pa

from app.fleet.pack import _READERS, _read_ahead
from tests.app.waiting import wait_until


def test_parts_are_read_a_few_ahead_and_come_in_order() -> None:
    lock, begun = threading.Lock(), 0
    drives = [f"{number:03d}" for number in range(500)]

    def read(drive: str) -> tuple[str, pa.Table]:
        nonlocal begun
        with lock:
            begun += 1
        return drive, pa.table({"t_s": [0.0]})

    got: list[str] = []
    with ThreadPoolExecutor(_READERS) as readers:
        for drive, _ in _read_ahead(readers, read, drives):
            got.append(drive)
            wanted = min(len(drives), len(got) + _READERS)
            assert wait_until(lambda wanted=wanted: begun == wanted), "as far ahead as there are readers"
    assert got == drives
