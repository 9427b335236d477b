"""A process at idle priority leaves the processor to all others."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import os, threading
from pipeline.common.idle_priority import take_idle_priority
ended = threading.Event()
other = threading.Thread(target=ended.wait)
other.start()
take_idle_priority()
threads = [int(each) for each in os.listdir("/proc/self/task")]
print(len(threads), all(os.sched_getscheduler(each) == os.SCHED_IDLE for each in threads), os.nice(0))
print(os.getsid(0) == os.getpid())
print(open("/proc/self/autogroup").read() if os.path.exists("/proc/self/autogroup") else "")
ended.set()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="idle scheduling is Linux's")
def test_a_process_at_idle_priority_with_all_its_threads() -> None:
    shown = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60)
    lines = shown.stdout.splitlines()
    assert lines[:2] == ["2 True 19", "True"]
    if Path("/proc/self/autogroup").exists():
        assert lines[2].endswith("nice 19")
