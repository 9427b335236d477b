"""Streams what is shown to a running rerun viewer, on its own thread, newest frame only."""

from __future__ import annotations

import logging
import socket
import threading
from urllib.parse import urlsplit

from app.core.latest_value import Newest
from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from app.views.rerun.view import ReplayError, RerunSink, ViewerAddress

logger = logging.getLogger("cipv.rerun")

_PATIENCE_S = 2.0
"""If a viewer takes longer than this for a frame, it counts as disconnected, so that no queue builds up."""
_RETRY_S = 2.0
_SCHEMES = ("rerun", "rerun+http", "rerun+https")


class RerunFeed:
    """Streams in a ``with`` block. Reconnects if there is no viewer or it disconnects; frames are dropped meanwhile.
    ReplayError if the address is not that of a viewer. sent: number of frames received by a viewer."""

    def __init__(self, engine: Engine, url: str) -> None:
        parts = urlsplit(url)
        if parts.scheme not in _SCHEMES or parts.hostname is None or parts.port is None:
            raise ReplayError(
                f"{url}: not the address of a rerun viewer; expected e.g. rerun+http://127.0.0.1:9876/proxy"
            )
        self._place = (parts.hostname, parts.port)
        self._viewer = ViewerAddress(url)
        self._engine = engine
        self._newest = Newest[Snapshot]()
        self.sent = 0
        self._thread = threading.Thread(target=self._work, name="cipv-rerun", daemon=True)

    def __enter__(self) -> RerunFeed:
        self._offer(self._engine.snapshot)
        self._stop_listening = self._engine.listen(self._offer)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop_listening()
        self._newest.end()
        self._thread.join(2 * _PATIENCE_S)

    def _offer(self, snapshot: Snapshot) -> None:
        if snapshot.processed is not None:
            self._newest.put(snapshot)

    def _work(self) -> None:
        sink: RerunSink | None = None
        sent: Snapshot | None = None
        while (newest := self._newest.take()) is not None:
            if sent is not None and newest.processed is sent.processed:
                continue
            if sink is not None and sent is not None and newest.uri != sent.uri:
                sink.abandon()
                sink = None
            if sink is None:
                sink = self._connect(newest)
            if sink is None or newest.processed is None:
                continue
            sink.show(newest.processed.frame, newest.processed.result)
            if sink.flush(_PATIENCE_S):
                sent = newest
                self.sent += 1
            else:
                sink.abandon()
                sink = None
        if sink is not None:
            sink.abandon()

    def _connect(self, snapshot: Snapshot) -> RerunSink | None:
        """A sink if a viewer listens; otherwise, after a while, None and the frame to retry with."""
        try:
            socket.create_connection(self._place, _PATIENCE_S).close()
        except OSError:
            self._newest.ends_within(_RETRY_S)
            self._newest.put_back(snapshot)
            return None
        return RerunSink(self._viewer, snapshot.title, snapshot.params.alignment)
