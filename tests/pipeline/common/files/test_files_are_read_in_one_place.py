"""Files that people name, and those beside them, are read by what refuses devices, pipes and files without end."""

from __future__ import annotations

import ast
from pathlib import Path

from tests.conftest import ROOT

READERS = frozenset({"read_text", "read_bytes"})
OF_THE_PROGRAM = frozenset(
    {
        "pipeline/inference/distance_laws.py",  # what is kept beside installed networks
        "pipeline/inference/model_registry.py",
        "pipeline/inference/tuning.py",
        "pipeline/common/watchdog.py",  # what the system says of processes and threads
        "pipeline/simulation/sensors/measured_noise.py",  # comes with the program
    }
)


def test_nothing_else_in_the_pipeline_reads_a_whole_file() -> None:
    found = set()
    for path in sorted((ROOT / "pipeline").rglob("*.py")):
        name = path.relative_to(ROOT).as_posix()
        if name.startswith(("pipeline/experiments/", "pipeline/training/")):  # run by hand, on files of ours
            continue
        for node in ast.walk(ast.parse(Path(path).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in READERS:
                found.add(name)
    assert found == OF_THE_PROGRAM
