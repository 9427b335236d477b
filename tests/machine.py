"""Prints which machine this is and how fast it computes, so that times of different runs can be told apart: clouds give
different processors under one name. ``python -m tests.machine``."""

from __future__ import annotations

import os
import platform
from pathlib import Path

from app.bench.calibration import Calibration

CPUINFO = Path("/proc/cpuinfo")
WIDE = ("avx512f", "avx2", "asimd")
"""Instruction sets that numpy and OpenCV choose by, the widest first."""


def processor(cpuinfo: str) -> str:
    """Model, family and widest instruction set of the first processor in the text of Linux's ``/proc/cpuinfo``; what
    Python knows where that is empty."""
    lines = [line.partition(":")[::2] for line in cpuinfo.partition("\n\n")[0].splitlines()]
    about = {name.strip(): value.strip() for name, value in lines}
    name = about.get("model name") or platform.processor() or platform.machine()
    if "cpu family" in about:
        name += f", family {about['cpu family']}, model {about.get('model', '?')}"
    has = (about.get("flags") or about.get("Features") or "").split()
    wide = next((each for each in WIDE if each in has), None)
    return f"{name}, {wide}" if wide else name


def main() -> None:
    cpuinfo = CPUINFO.read_text(encoding="utf-8") if CPUINFO.exists() else ""
    loop_ms = Calibration().row()["cpu_ms"]
    print(f"machine: {processor(cpuinfo)}; {os.cpu_count()} cores; calibration of `cipv bench`: {loop_ms:.2f} ms")


if __name__ == "__main__":
    main()
