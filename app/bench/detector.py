"""Benchmark of the network: image in, candidate boxes out, compared with OpenCV's engine on the same file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Any

import cv2
import numpy as np

from app.bench.timing import figures, interleaved
from pipeline.types import U8
from pipeline.vision.detector import Detector

_PEER = "cv2.dnn"


def stages(images: Sequence[U8], detector: Detector, budget_s: float) -> dict[str, dict[str, Any]]:
    """``{"detector": …}`` as ``cipv bench --json`` prints it; empty without an image. images: (H, W, 3) uint8, used in
    turn. The peer runs the same graph at the same size with the same number of threads; it is omitted if it cannot."""
    if not images:
        return {}
    ours = _in_turn(detector.detect, images)
    contestants = {"ours": ours}
    peer, absent = _opencv(detector, images)
    if peer is not None:
        contestants[_PEER] = peer
    threads = cv2.getNumThreads()
    cv2.setNumThreads(detector.threads)
    try:
        times = interleaved(contestants, budget_s)
    finally:
        cv2.setNumThreads(threads)
    median = float(np.median(times["ours"]) * 1e3)
    peers: dict[str, dict[str, Any]] = {_PEER: {"median_ms": None, "ratio": None, "absent": absent}}
    if peer is not None:
        peer_ms = float(np.median(times[_PEER]) * 1e3)
        peers = {_PEER: {"median_ms": round(peer_ms, 4), "ratio": round(peer_ms / median, 2)}}
    return {
        "detector": {
            **figures(times["ours"]),
            "peers": peers,
            "model": detector.name,
            "providers": list(detector.providers),
        }
    }


def _in_turn(work: Callable[[U8], object], images: Sequence[U8]) -> Callable[[], object]:
    turn = cycle(images)
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
