"""A worker gives freed memory back after each recording."""

from __future__ import annotations

import ctypes
import sys
from pathlib import Path

import psutil
import pytest

from app.fleet.batch.work import run_drive
from tests.app.fleet.fleets import job_of

BLOCK_BYTES, BLOCKS = 64 << 10, 2000
"""128 MB, in blocks that glibc takes from its heap."""


@pytest.mark.skipif(sys.platform != "linux" or not hasattr(ctypes.CDLL(None), "malloc_trim"), reason="needs glibc")
def test_gaps_between_what_stays_are_given_back(fleet: Path, tmp_path: Path):
    run_drive(job_of(str(fleet / "near-0.mcap"), tmp_path / "first"))
    libc = ctypes.CDLL(None)
    libc.malloc.restype, libc.malloc.argtypes, libc.free.argtypes = (
        ctypes.c_void_p,
        [ctypes.c_size_t],
        [ctypes.c_void_p],
    )
    held = [libc.malloc(BLOCK_BYTES) for _ in range(BLOCKS)]
    for address in held:
        ctypes.memset(address, 1, BLOCK_BYTES)
    stay = held[::20]
    for address in set(held) - set(stay):
        libc.free(address)
    process = psutil.Process()
    before = process.memory_info().rss
    run_drive(job_of(str(fleet / "far-0.mcap"), tmp_path / "second"))
    given_back = before - process.memory_info().rss
    for address in stay:
        libc.free(address)
    assert given_back > BLOCK_BYTES * BLOCKS / 2
