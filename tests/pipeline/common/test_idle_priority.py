"""A process at idle priority leaves the processor to all others."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import os
from pipeline.common.idle_priority import take_idle_priority
take_idle_priority()
print(os.sched_getscheduler(0) == os.SCHED_IDLE, os.nice(0))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="idle scheduling is Linux's")
def test_a_process_at_idle_priority() -> None:
    shown = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True, timeout=60)
    assert shown.stdout.split() == ["True", "19"]
