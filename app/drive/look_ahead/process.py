"""``python -m app.drive.look_ahead.process``: runs networks at idle priority for the server that started it, one
image after another, and ends with it.

It starts at a moderate niceness, because imports and opening networks take a second or two of processor time; from
then on it computes only while no other program wants the processor.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np

from app.core.kept_detections import row_of
from app.core.pipe_messages import PipeClosed, exactly, receive, send
from app.drive.look_ahead.messages import ImageHeader, NetworkFile, NetworkReply, Networks
from pipeline.common.errors import BadInput
from pipeline.common.idle_priority import be_killed_first, take_idle_priority
from pipeline.lanes.network import LaneNetwork, load_lane_network
from pipeline.vision.detector import Detector, open_detector

_STARTS_AT = 10
"""Niceness until the networks are open."""
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
"""A terminal or a supervisor sends these to the whole group; the server decides when this process ends."""


def main() -> None:
    """Serve until the server closes the pipe."""
    for name in _SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    be_killed_first()
    with suppress(OSError, AttributeError):
        os.nice(_STARTS_AT)
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what a library prints must not get between the answers
    with suppress(PipeClosed, BrokenPipeError):
        _serve(sys.stdin.buffer, answers)
    os._exit(0)  # threads of the runtime may still be running


def _serve(requests: IO[bytes], answers: IO[bytes]) -> None:
    try:
        networks = [_opened(file) for file in receive(requests, Networks).files]
    except (BadInput, OSError) as error:
        send(answers, NetworkReply(error=str(error)))
        return
    take_idle_priority()
    send(answers, NetworkReply())
    while True:
        header = receive(requests, ImageHeader)
        pixels = exactly(requests, header.height * header.width * 3)
        bgr = np.frombuffer(pixels, np.uint8).reshape(header.height, header.width, 3)
        send(answers, _answer(networks[header.network], bgr))


def _answer(network: Detector | LaneNetwork, bgr: np.ndarray) -> NetworkReply:
    try:
        return NetworkReply(row_of(0, network.name, network.detect(bgr)))
    except Exception as error:  # a network may fail in any way; the server runs it again, and reports what it finds
        return NetworkReply(error=f"{type(error).__name__}: {error}")


def _opened(file: NetworkFile) -> Detector | LaneNetwork:
    """The network; BadInput if it differs from the server's, for example because the file has been replaced."""
    network: Detector | LaneNetwork
    if file.outline is not None:
        network = load_lane_network(Path(file.path), file.threads, file.outline, file.window)
    else:
        network = open_detector(file.path, None, file.threads)
        if network.input_size != file.input_size:
            network = open_detector(file.path, None, file.threads, file.input_size)
    if network.name != file.name:
        raise BadInput(f"{file.path} is not the network {file.name} any more")
    return network


if __name__ == "__main__":
    main()
