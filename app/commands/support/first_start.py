"""What a first start would wait for, done once by ``make install``: kernels are compiled, and modules to bytecode."""

from __future__ import annotations

from importlib import import_module

from pipeline.detection import Detectors, detector_for, lanes_for
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import open_source

STARTED = ("app.cli", "app.commands.serve", "app.web.server", "app.views.scene_feed", "app.labels.store.drive_labels")
"""Of the dashboard; what they import comes with them."""


def main() -> None:
    """The dashboard's modules, and a frame of its demo through the whole line."""
    for name in STARTED:
        import_module(name)
    source = open_source("sim:straight")
    next(iter(run(source, Params(), Detectors(detector_for(source), lanes_for(source)))))


if __name__ == "__main__":
    main()
