"""Compiles numba kernels and Python bytecode once, during ``make install``, to make the first start fast."""

from __future__ import annotations

from importlib import import_module

from app.commands.support.progress_bars import frames_progress, task_progress
from pipeline.common.garbage_collection import collect_less_often
from pipeline.detection import Detectors, detector_for, lanes_for
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import open_source

STARTED = ("app.cli", "app.commands.serve", "app.web.server", "app.views.scene_feed", "app.labels.store.drive_labels")
"""Modules of the dashboard, which import all others."""


def main() -> None:
    """Import the dashboard's modules and run the pipeline on one frame of the demo."""
    collect_less_often()
    with frames_progress() as bar:
        progress = task_progress(bar, "compiling", len(STARTED) + 1)
        for done, name in enumerate(STARTED):
            progress(done, len(STARTED) + 1)
            import_module(name)
        progress(len(STARTED), len(STARTED) + 1)
        source = open_source("sim:straight")
        next(iter(run(source, Params(), Detectors(detector_for(source), lanes_for(source)))))


if __name__ == "__main__":
    main()
