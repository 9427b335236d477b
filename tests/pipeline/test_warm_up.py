"""After warming up no frame waits for a compiler, nor for a collector that looks through all modules: in a process of
its own, where no other test compiled anything."""

from __future__ import annotations

import subprocess
import sys

_DRIVE = """
import gc, dataclasses
import numpy as np
import velodyne_decoder
from numba.core.dispatcher import Dispatcher
from pipeline.params import Params
from pipeline.sources import open_source
from pipeline.step import State, step
from pipeline.warm_up import warm_up
from pipeline.types import RawBoxes, RawLanes

kernels = [thing for thing in gc.get_objects() if isinstance(thing, Dispatcher)]
loaded = len(gc.get_objects())

def compiled():
    return {f"{each.py_func.__module__}.{each.py_func.__name__}": len(each.signatures) for each in kernels}

v = np.linspace(400.0, 700.0, 60, dtype=np.float32)
points = np.concatenate([np.column_stack([640.0 + side * (v - 360.0), v]) for side in (-1.0, 1.0)]).astype(np.float32)
boxes = RawBoxes("made", np.array([[600, 330, 680, 400]], np.float32), np.array([0.9], np.float32), ("car",))
lanes = RawLanes("made", points, np.ones(len(points), np.float32), np.repeat([0, 1], 60).astype(np.int32))
source, state = open_source("sim:straight"), State()
warm_up()
before = compiled()
collections = sum(each["collections"] for each in gc.get_stats())
for index in range(4):
    frame = dataclasses.replace(source.frame(index), raw_boxes=boxes, raw_lanes=lanes)
    for _ in range(5):
        after, result = step(state, frame, Params())
    state = after
assert sum(each["collections"] for each in gc.get_stats()) <= collections + 1, "the collector stops the frames"
assert len(gc.get_objects()) < loaded / 10, "the collector looks through all that is loaded"
assert result.objects and result.layers.lanes is not None
line = {name for name in before if name.startswith("pipeline.") and not name.startswith("pipeline.simulation.")}
print(sorted(name for name, count in compiled().items() if name in line and count != before[name]))
"""


def test_a_first_frame_compiles_nothing() -> None:
    done = subprocess.run([sys.executable, "-c", _DRIVE], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"
    assert done.stderr == "", "extension modules complain of leaks when the process ends"
