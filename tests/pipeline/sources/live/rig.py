"""The real live path on loopback: a replayer in a thread sends and a live source receives, on ports chosen by the
system."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from types import TracebackType
from typing import Any

from pipeline.replay.faults import Fault
from pipeline.replay.messages import Message
from pipeline.replay.replayer import ReplayCounts, replay
from pipeline.replay.senders import open_senders
from pipeline.sources.live.config import LiveConfig
from pipeline.sources.live.source import LiveSensors
from pipeline.types import Frame

PATIENCE_S = 30.0
"""Timeout of waits for a condition; reached only if a test fails, even on a busy machine."""


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def tcp_device(talk: Callable[[socket.socket], None]) -> Iterator[int]:
    """A device that talks to every client in a thread of its own, until that hangs up; yields its port."""

    def talk_to(client: socket.socket) -> None:
        with client, suppress(OSError):
            client.settimeout(PATIENCE_S)
            talk(client)

    def accept(listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                threading.Thread(target=talk_to, args=(listener.accept()[0],), daemon=True).start()

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=accept, args=(listener,), daemon=True).start()
        try:
            yield int(listener.getsockname()[1])
        finally:
            listener.shutdown(socket.SHUT_RDWR)


def loopback_config(**more: Any) -> LiveConfig:
    """LiDAR, MJPEG camera, GNSS receiver and ego motion from it, all on 127.0.0.1. more: replaces sections."""
    sections: dict[str, Any] = {
        "lidar": {
            "data_port": free_port(socket.SOCK_DGRAM),
            "position_port": free_port(socket.SOCK_DGRAM),
            "interface": "127.0.0.1",
        },
        "camera": {"url": f"http://127.0.0.1:{free_port(socket.SOCK_STREAM)}/video"},
        "gnss": {"udp_port": free_port(socket.SOCK_DGRAM), "interface": "127.0.0.1"},
        "ego": {"source": "gnss"},
    }
    return LiveConfig.model_validate({name: value for name, value in {**sections, **more}.items() if value is not None})


class Replaying(AbstractContextManager["Replaying"]):
    """A context in which the messages are replayed, until they end or the block does."""

    def __init__(self, config: LiveConfig, messages: Iterable[Message], faults: Sequence[Fault] = ()) -> None:
        self._senders = open_senders(config)
        self._stop = threading.Event()
        self._messages, self._faults = messages, faults
        self.sent: ReplayCounts | None = None
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._play, name="replaying")

    @property
    def is_over(self) -> bool:
        return not self._thread.is_alive()

    def _play(self) -> None:
        try:
            self.sent = replay(self._messages, self._senders, faults=self._faults, stopped=self._stop.is_set)
        except Exception as error:  # reported by the test that times out
            self.error = error

    def stop(self) -> None:
        """Stop sending."""
        self._stop.set()

    def __enter__(self) -> Replaying:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.stop()
        self._thread.join(PATIENCE_S)
        for sender in self._senders.values():
            sender.close()
        assert self.error is None


def frames_until(source: LiveSensors, done: Callable[[Frame], bool], seen: list[Frame] | None = None) -> Frame:
    """The first frame that fulfils ``done``. All frames are added to ``seen``."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        frame = source.next(1.0)
        if frame is None:
            continue
        if seen is not None:
            seen.append(frame)
        if done(frame):
            return frame
    raise AssertionError(f"no such frame within {PATIENCE_S:g} s; sensors: {source.health()}")


def opened(config: LiveConfig, sensors: list[LiveSensors]) -> LiveSensors:
    """A started live source, added to the fixture ``sensors``, which closes it."""
    source = LiveSensors("live:loopback", config)
    sensors.append(source)
    source.start()
    return source
