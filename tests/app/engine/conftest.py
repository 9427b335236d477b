"""An engine with a recording that counts requests."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from app.drive import compute_scheduler
from app.engine.engine import Engine
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.engine.running import WAIT_S, Start


@pytest.fixture
def start(monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    """Starts an engine on a recording, paused on its first frame. Input counts as stopped immediately."""
    monkeypatch.setattr(compute_scheduler, "HAND_RESTS_S", 0.0)
    with ExitStack() as stack:

        def begin(
            recording: Recording | None = None, detector: CountingDetector | None = None, **options
        ) -> tuple[Engine, Recording, CountingDetector]:
            recording, detector = recording or Recording(), detector or CountingDetector()
            engine = Engine(opener(recording), lambda _: detector, Params(), uri=recording.uri, **options)
            engine.start()
            stack.callback(engine.stop)
            stack.callback(recording.gate.set)
            engine.wait_for(lambda s: s.processed is not None, WAIT_S)
            return engine, recording, detector

        yield begin
