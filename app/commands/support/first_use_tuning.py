"""Tunes networks that this machine uses for the first time: in a process of its own at idle priority, while the machine
is otherwise idle. The next opening of the network uses what was found.

Results never depend on it: only settings with equal outputs, bit by bit, may be chosen.
"""

from __future__ import annotations

import os
import queue
import subprocess
import sys
import threading
from pathlib import Path
from time import sleep

from app.bench.other_load import load_warning, read_cpu_times
from pipeline.common.errors import BadInput
from pipeline.common.idle_priority import take_idle_priority
from pipeline.inference.runtime import ways_of
from pipeline.inference.tuning import USUAL_THREADS, Trial, is_tuned, keep_fastest, tune
from pipeline.lanes.network import LaneNetwork
from pipeline.vision.detector import Detector

_FIRST_PICTURE_S = 60.0
"""Time after the opening in which the user looks at the first images and the drive begins to be computed."""
_IDLE_S = 5.0
"""For so long the machine must have been idle."""


class FirstUseTuning:
    """``used`` is called with every network that was opened. A context manager: at its end nothing is tuned any more.

    delay_s: how long after the opening tuning may begin.
    """

    def __init__(self, delay_s: float = _FIRST_PICTURE_S) -> None:
        self._delay_s = delay_s
        self._paths: queue.SimpleQueue[Path] = queue.SimpleQueue()
        self._known: set[Path] = set()
        self._ended = threading.Event()
        self._child: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._work, name="cipv-first-use", daemon=True)

    def __enter__(self) -> FirstUseTuning:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        child = self._child
        if child is not None:
            child.kill()

    def used(self, network: object) -> None:
        """A network was opened; anything else, such as a detector without a network, is ignored."""
        if isinstance(network, Detector | LaneNetwork) and network.path not in self._known:
            self._known.add(network.path)
            self._paths.put(network.path)

    def _work(self) -> None:
        while not self._ended.is_set():
            path = self._paths.get()
            if not self._ended.wait(self._delay_s) and not is_tuned(path):
                self._tune(path)

    def _tune(self, path: Path) -> None:
        # the process ends with this one, however this one ends: then its standard input does, too
        with subprocess.Popen(
            [sys.executable, "-m", __name__, str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        ) as child:
            self._child = child
            if self._ended.is_set():
                child.kill()
            child.wait()


def main() -> None:
    """Tune the network in the file that the command line names, once the machine is idle; exit with 1 if that is not
    possible."""
    take_idle_priority()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    path = Path(sys.argv[1])
    try:
        while not _tuned(path):
            pass
    except (BadInput, OSError) as error:
        sys.exit(str(error))


def _tuned(path: Path) -> bool:
    """Wait until the machine is idle, tune the network, and keep the result unless the machine was busy meanwhile."""
    while not _is_idle():
        pass
    before = read_cpu_times()
    trials: list[Trial] = list(tune(ways_of(path), USUAL_THREADS))
    if load_warning(before, read_cpu_times()) is not None:
        return False
    keep_fastest(path, trials)
    return True


def _is_idle() -> bool:
    """Whether nothing else used the machine during the last seconds."""
    before = read_cpu_times()
    sleep(_IDLE_S)
    return load_warning(before, read_cpu_times()) is None


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
