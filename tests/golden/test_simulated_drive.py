"""What the line believed of the embedded drive when somebody last looked at it and found it right.

A change that moves these numbers must be looked at; then `CIPV_UPDATE_GOLDEN=1 pytest tests/golden` writes them anew.
Numbers are compared within what another processor's rounding may do, decisions exactly.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from pipeline.params import preset
from pipeline.results import to_json
from pipeline.run import Detectors, detector_for, run
from pipeline.sources import open_source

FOLDER = Path(__file__).parent
EVERY = 5


def summary(name: str) -> list[dict[str, Any]]:
    """Every fifth frame of the drive with the LiDAR alone: who leads, how far, why, and what ACC does."""
    kept = []
    for frame, result in run(open_source("sim:straight"), preset(name), Detectors()):
        if frame.index % EVERY == 0:
            kept.append(_decisions(to_json(result)))
    return kept


def _decisions(full: dict[str, Any]) -> dict[str, Any]:
    """Without the objects' numbers: one roadside cluster more, on another processor, would shift them all."""
    lead, command = full["cipv"] or {}, full["acc"]
    return {
        "frame": full["frame"],
        "cipv": {key: lead[key] for key in lead if key != "id"},
        "acc": {key: command[key] for key in command if key != "reason"},
        "in_path_m": [item["distance_m"] for item in full["objects"] if item["in_path"]],
    }


@pytest.mark.parametrize("name", ["default", "paper"])
def test_golden(name: str) -> None:
    file, now = FOLDER / f"straight_{name}.json", summary(name)
    if os.environ.get("CIPV_UPDATE_GOLDEN"):
        file.write_text("[\n" + ",\n".join(json.dumps(row) for row in now) + "\n]\n", encoding="utf-8")
    golden = json.loads(file.read_text(encoding="utf-8"))
    assert len(now) == len(golden)
    for ours, theirs in zip(now, golden, strict=True):
        assert same(ours, theirs), f"frame {ours['frame']}:\n{ours}\nwas\n{theirs}"


def same(a: Any, b: Any) -> bool:
    """Equal, floats to the centimetre."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, float) and isinstance(b, float):
        return a == pytest.approx(b, abs=0.01, rel=0.002)
    return bool(a == b)


def test_nothing_brakes_hard_on_a_drive_that_needs_none() -> None:
    """With both sensors and the embedded detector: neither ACC's TTC rule nor emergency braking finds a phantom."""
    source = open_source("sim:straight")
    states = {
        frame.name: result.acc for frame, result in run(source, preset("default"), Detectors(detector_for(source)))
    }
    assert all(command is not None for command in states.values())
    phantoms = {name: c.reason for name, c in states.items() if c and c.state not in ("cruise", "follow")}
    assert not phantoms
