"""Reports on standard error which live sensors have not delivered data yet."""

from __future__ import annotations

import sys

from pipeline.sources.live.health import not_delivering
from pipeline.types.source import LiveSource


class Waiting:
    """Prints which sensors have not delivered data yet, whenever that changes. Called while there is no tick."""

    def __init__(self, live: LiveSource) -> None:
        self._live = live
        self._said = ""

    def __call__(self) -> None:
        text = f"cipv: waiting for sensors: {not_delivering(self._live.health())}"
        if text != self._said:
            print(text, file=sys.stderr)
        self._said = text
