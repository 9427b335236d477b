"""The server's side of the process that runs networks in the background."""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import IO, Any, cast

import numpy as np

from app.core.kept_detections import answer_of
from app.core.pipe_messages import PipeClosed, receive, send
from app.drive.look_ahead.messages import ImageHeader, NetworkFile, NetworkReply, Networks
from pipeline.common.errors import BadInput
from pipeline.common.watchdog import at_work
from pipeline.detection import Detectors
from pipeline.inference.model_registry import EMBEDDED_FILE
from pipeline.lanes.network import LaneNetwork
from pipeline.types import U8, RawBoxes, RawLanes
from pipeline.vision.detector import Detector

_COMMAND = (sys.executable, "-m", "app.drive.look_ahead.process")
_CPU = "CPUExecutionProvider"


class ProcessEnded(Exception):
    """The process ended, or was ended, before it answered."""


class NetworkFailed(BadInput):
    """A network cannot be opened in the process, or failed on an image there; the text gives the reason."""


def is_worth_a_process(detectors: Detectors) -> bool:
    """Whether a drive's networks should run in a process of their own: where one runs on the processor, unless it is
    the embedded one, which is so small that it takes its turn in the server. A network on a graphics card costs the
    server no processor time, and a second copy would take the card's memory."""
    networks = _networks(detectors)
    return any(each.path != EMBEDDED_FILE for each in networks) and all(each.providers[0] == _CPU for each in networks)


class NetworkProcess:
    """Runs the networks of ``detectors`` in a process, which starts at the first image. For one thread; ``end`` from
    any."""

    def __init__(self, detectors: Detectors) -> None:
        self._networks = _networks(detectors)
        self._detectors = detectors
        self._process: subprocess.Popen[bytes] | None = None
        self._has_ended = False
        self.is_opening = False
        """Whether the process has been started and its networks are not open yet."""

    @property
    def detectors(self) -> Detectors:
        """The detectors with their networks in the process: the same names, the same detections. They raise
        ProcessEnded and NetworkFailed."""
        asked = self._detectors
        far = asked.far
        if far is not None:
            far = replace(far, detector=cast("Any", self._there(far.detector)))
        lanes, far_lanes = self._there(asked.lanes), self._there(asked.far_lanes)
        return replace(asked, boxes=self._there(asked.boxes), lanes=lanes, far=far, far_lanes=far_lanes)

    def detect(self, number: int, bgr: U8) -> RawBoxes | RawLanes:
        """The detections of a network in an image (H, W, 3) uint8."""
        if self._process is None:
            self._start()
        image = np.ascontiguousarray(bgr)
        answer = self._ask(ImageHeader(number, image.shape[0], image.shape[1]), image.data, self._networks[number].name)
        if answer.row is None:
            raise NetworkFailed(answer.error)
        return answer_of(answer.row)

    def end(self) -> None:
        """End the process; an image in progress is dropped."""
        self._has_ended = True
        process = self._process
        if process is not None:
            process.kill()
            process.wait()

    def close(self) -> None:
        """``end``, and release the pipes: for the thread that calls ``detect``."""
        self.end()
        process = self._process
        for stream in (process.stdin, process.stdout) if process is not None else ():
            with suppress(OSError):  # an image could not be delivered
                _pipe(stream).close()

    def _start(self) -> None:
        self.is_opening = True
        self._process = subprocess.Popen(
            _COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        if self._has_ended:  # meanwhile
            self.end()
        answer = self._ask(Networks(tuple(map(_file_of, self._networks))), b"", "opening")
        if answer.error:
            raise NetworkFailed(answer.error)
        self.is_opening = False

    def _ask(self, message: Networks | ImageHeader, pixels: memoryview | bytes, what: str) -> NetworkReply:
        process = self._process
        assert process is not None
        try:
            with at_work(f"{what} in the background", process.pid):
                send(_pipe(process.stdin), message, pixels)
                return receive(_pipe(process.stdout), NetworkReply)
        except (PipeClosed, OSError, ValueError):
            raise ProcessEnded("its process ended") from None

    def _there(self, network: Any) -> Any:
        """The detector with its network in the process; anything else, such as the classical lanes, stays."""
        number = next((k for k, each in enumerate(self._networks) if each is network), None)
        return network if number is None else _Remote(network.name, self, number)


@dataclass(frozen=True)
class _Remote:
    """A ``Detects`` whose network runs in the process."""

    name: str
    process: NetworkProcess = field(repr=False)
    number: int
    notes: tuple[str, ...] = ()

    def detect(self, bgr: U8) -> Any:
        return self.process.detect(self.number, bgr)


def _networks(detectors: Detectors) -> list[Detector | LaneNetwork]:
    """The networks among the detectors."""
    far = detectors.far.detector if detectors.far is not None else None
    asked = (detectors.boxes, far, detectors.lanes, detectors.far_lanes)
    return [each for each in asked if isinstance(each, Detector | LaneNetwork)]


def _file_of(network: Detector | LaneNetwork) -> NetworkFile:
    outline, window = (network.outline, network.window) if isinstance(network, LaneNetwork) else (None, None)
    return NetworkFile(network.name, str(network.path.resolve()), network.threads, network.input_size, outline, window)


def _pipe(stream: IO[bytes] | None) -> IO[bytes]:
    assert stream is not None
    return stream
