"""Benchmark of the network in both views, the whole image and the far one: image in, candidate boxes out, compared with
OpenCV's engine on the same file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any, TypeVar

import cv2
import numpy as np

from app.bench.timing import figures, interleaved
from pipeline.types import U8, Frame
from pipeline.vision.detector import Detector
from pipeline.vision.far_view import FarView

_PEER = "cv2.dnn"
Input = TypeVar("Input")


def stages(
    frames: Sequence[Frame], detector: Detector, budget_s: float, far: FarView | None = None
) -> dict[str, dict[str, Any]]:
    """``{"detector": …, "far_view": …}`` as ``cipv bench --json`` prints it: the whole image, and the window of the
    second pass; the latter only with ``far``. Empty without an image. Frames are used in turn. The peer runs the graph
    of the whole image at the same size with the same number of threads; it is omitted if it cannot."""
    frames = [frame for frame in frames if frame.image is not None]
    if not frames:
        return {}
    images = [frame.image.bgr for frame in frames if frame.image is not None]
    contestants = {"detector": _in_turn(detector.detect, images)}
    if far is not None:
        contestants["far_view"] = _in_turn(
            lambda pair: far.of(pair[0]).detect(pair[1]), list(zip(frames, images, strict=True))
        )
    peer, absent = _opencv(detector, images)
    if peer is not None:
        contestants[_PEER] = peer
    threads = cv2.getNumThreads()
    cv2.setNumThreads(detector.threads)
    try:
        times = interleaved(contestants, budget_s)
    finally:
        cv2.setNumThreads(threads)
    peers: dict[str, dict[str, Any]] = {_PEER: {"median_ms": None, "ratio": None, "absent": absent}}
    if peer is not None:
        peer_s, ours_s = (float(np.median(times[name])) for name in (_PEER, "detector"))
        peers = {_PEER: {"median_ms": round(peer_s * 1e3, 4), "ratio": round(peer_s / ours_s, 2)}}
    named = {"model": detector.name, "providers": list(detector.providers)}
    rows = {"detector": {**figures(times["detector"]), "peers": peers, **named}}
    if far is not None:
        rows["far_view"] = {**figures(times["far_view"]), "peers": {}, "model": far.name}
    return rows


def _in_turn(work: Callable[[Input], object], inputs: Sequence[Input]) -> Callable[[], object]:
    turn = cycle(inputs)
    return lambda: work(next(turn))


def _opencv(detector: Detector, images: Sequence[U8]) -> tuple[Callable[[], object] | None, str]:
    """``cv2.dnn`` on the same graph with our pre-processing and decoding; None and why if OpenCV cannot run it."""
    try:
        network = cv2.dnn.readNetFromONNX(np.frombuffer(detector.graph, np.uint8))

        def detect(bgr: U8) -> object:
            network.setInput(detector.blob(bgr))
            outputs = network.forward(network.getUnconnectedOutLayersNames())
            return detector.decode([np.asarray(output, np.float32) for output in outputs], bgr.shape[:2])

        detect(images[0])
    except (cv2.error, ValueError, IndexError) as error:  # the last two: its outputs have other shapes
        return None, f"OpenCV cannot run this graph: {' '.join(str(getattr(error, 'err', '') or error).split())}"
    return _in_turn(detect, images), ""
