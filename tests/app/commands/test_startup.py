"""What a start waits for: the libraries that are imported before the first image, and before a command's help."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
DRAWING = {"fastapi", "uvicorn", "viser", "rerun", "rich.progress", "prometheus_client"}
RECORDING = {"mcap", "foxglove", "rosbags", "velodyne_decoder", "av", "serial", "can", "pynmea2", "zstandard"}
LABELS = {
    "sqlalchemy",
    "alembic",
    "psycopg",
    "trackeval",
    "scipy.interpolate",
    "pipeline.labels.formats.openlabel.read",
}
LINE = {"numba", "scipy.optimize", "onnxruntime", "onnx", "pyproj"}
SERVING = LABELS | RECORDING | {"open3d", "dask", "scipy.ndimage", "viser", "rerun", "rich", "app.clips.video"}


def run(program: str) -> str:
    """Standard output of a new interpreter."""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout


def imported(program: str) -> set[str]:
    """The modules that are loaded after a program has run."""
    return set(json.loads(run(f"{program}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))").splitlines()[-1]))


@pytest.mark.parametrize(
    ("module", "without"),
    [
        ("app.web.server", SERVING),
        ("app.commands.params", LINE | SERVING - {"rich"} | DRAWING - {"rich.progress"} | {"cv2"}),
        (
            "app.commands.info",
            LINE - {"numba"} | LABELS | DRAWING - {"rich.progress"} | {"rosbags", "velodyne_decoder"},
        ),
        (
            "app.commands.labels.labels",
            LINE - {"numba"} | {"sqlalchemy", "alembic", "trackeval", "scipy.interpolate", "viser"},
        ),
    ],
)
def test_a_command_imports_what_it_needs(module: str, without: set[str]) -> None:
    assert without & imported(f"import {module}") == set()


USED_EVERY_DAY = ("serve", "run", "evaluate", "record", "sessions", "labels.files", "labels", "replay", "live")


def test_a_users_process_has_neither_the_experiments_nor_what_trains_the_detector() -> None:
    """All commands in one process: a module that is then not loaded is imported by none of them."""
    there = imported(
        "\n".join(f"import app.commands.{command}" for command in USED_EVERY_DAY) + "\nimport app.web.server"
    )
    assert [name for name in there if name.startswith(("pipeline.experiments", "pipeline.training", "torch"))] == []


def test_garbage_is_collected_less_often_before_a_command_is_imported() -> None:
    """Otherwise, the collector takes a tenth of the time in which modules are imported."""
    told = "import app.commands.keys as chosen, gc\ndef asked(*_): print(gc.get_threshold()[0])\nchosen.Keys = asked"
    typed = "import sys\nfrom app.cli import main\ntry: main(['keys'])\nexcept SystemExit: pass"
    assert int(run(f"{told}\n{typed}").splitlines()[0]) > 7 * 700


def test_the_list_of_commands_needs_none_of_them() -> None:
    there = imported("from app.cli import main\ntry: main(['--help'])\nexcept SystemExit: pass")
    assert {"numpy", "pydantic", *LINE, *SERVING, *DRAWING} & there <= {"rich"}
    packages = {"app.commands.labels", "app.commands.fleet"}  # empty ones; a search for what is in them imports them
    assert not [name for name in there - packages if name.startswith("app.commands.")]


def test_the_engine_opens_the_recording_before_the_server_is_imported() -> None:
    engine = "class Engine:\n    class labels:\n        class kept: pass\n    def start(self): raise SystemExit"
    serving = "from app.commands.serve import serve\ntry: serve(Engine(), port=0)\nexcept SystemExit: pass"
    assert (SERVING | DRAWING) & imported(f"{engine}\n{serving}") == set()
