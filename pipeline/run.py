"""Source → detectors → step: one frame (``advance``), or every frame of a source in order (``run``, ``run_live``)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Literal, NamedTuple

from pipeline import lidar_branch
from pipeline.common.ahead import ahead
from pipeline.common.files.user_files import Overloaded
from pipeline.detection import Detectors, Look, detect, look
from pipeline.live_detection import LiveDetectors
from pipeline.params import Params
from pipeline.step import State, step
from pipeline.types import Frame, Result
from pipeline.types.source import LiveSource, Source
from pipeline.warm_up import warm_up

_SILENCE_S = 0.5
"""Wait for live sensors between two calls of ``on_silence``."""
_BESIDE = ThreadPoolExecutor(thread_name_prefix="lidar")
"""Processes the sweep while detectors process the image."""
_TRIES, _RETRY_S = 10, 0.5
"""Of reading a frame while the system has no memory or no file handle left."""

Sensors = Literal["lidar", "camera", "both"]


def only(frame: Frame, sensors: Sensors) -> Frame:
    """The frame as a car with only these sensors would have it. The image stays, so that it can be displayed;
    detections in it are removed."""
    if sensors == "lidar":
        return replace(frame, raw_boxes=None, raw_lanes=None, scans={})
    if sensors == "camera":
        return replace(frame, sweep=None, scans={})
    return frame


def sensed(frame: Frame, detectors: Detectors, sensors: Sensors = "both", ask: Look = look) -> Frame:
    """A frame of a source prepared for ``step``: detectors have processed its image, and data of disabled sensors is
    removed. With LiDAR alone no detector runs."""
    return only(frame if sensors == "lidar" else detect(frame, detectors, ask), sensors)


class Advanced(NamedTuple):
    """One frame of a source after the pipeline."""

    frame: Frame
    """The frame as passed to ``step``, detections included."""
    state: State
    """The state after it."""
    result: Result
    """Its result."""
    lidar: lidar_branch.LidarBranch
    """What was computed without the detections; helps to run the frame again with other parameters."""


def advance(
    state: State, frame: Frame, params: Params, detectors: Detectors, sensors: Sensors = "both", ask: Look = look
) -> Advanced:
    """Run one frame of a source: its sweep beside the detectors, then the rest of the step.

    Args:
        state: state after the previous frame; ``State()`` at the start.
        frame: from the source.
        params: of this frame.
        detectors: detectors that process its image.
        sensors: which sensors the car has.
        ask: how a detector is called: directly, or through a cache.
    """
    beside = _BESIDE.submit(lidar_branch.follow, state, only(frame, sensors), params)
    frame = sensed(frame, detectors, sensors, ask)
    lidar = beside.result()
    state, result = step(state, frame, params, lidar)
    return Advanced(frame, state, result, lidar)


def run(
    source: Source, params: Params, detectors: Detectors, sensors: Sensors = "both", ask: Look = look
) -> Iterator[tuple[Frame, Result]]:
    """Each frame of a recording with its result. Without detectors only the LiDAR is used. ask: how a detector is
    called: directly, or through a cache of earlier outputs. Each frame is read while the one before it is processed."""
    return through(ahead(partial(patiently, source), range(len(source))), params, detectors, sensors, ask)


def run_live(
    source: LiveSource,
    params: Params,
    detectors: Detectors,
    sensors: Sensors = "both",
    on_silence: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Frame, Result]]:
    """The newest tick of live sensors with its result, repeatedly until the iterator is closed, which releases the
    sensors. on_silence: called every half second while no sensor delivers."""
    live = LiveDetectors(detectors)
    return _through(_ticks(source, params, live, on_silence), params, live.of, sensors, live.look)


def patiently(source: Source, index: int) -> Frame:
    """Read a frame, with retries if the system is temporarily unable to read. Overloaded if that does not help."""
    for _ in range(_TRIES):
        try:
            return source.frame(index)
        except Overloaded:
            time.sleep(_RETRY_S)
    return source.frame(index)


def through(
    frames: Iterable[Frame], params: Params, detectors: Detectors, sensors: Sensors = "both", ask: Look = look
) -> Iterator[tuple[Frame, Result]]:
    """Each of these frames with its result, starting from an empty state."""
    return _through(frames, params, lambda frame: (frame, detectors), sensors, ask)


def _through(
    frames: Iterable[Frame],
    params: Params,
    prepared: Callable[[Frame], tuple[Frame, Detectors]],
    sensors: Sensors,
    ask: Look = look,
) -> Iterator[tuple[Frame, Result]]:
    warm_up()
    state = State()
    for frame in frames:
        ready, detectors = prepared(frame)
        seen, state, result, _ = advance(state, ready, params, used(detectors, params), sensors, ask)
        yield seen, result


def used(detectors: Detectors, params: Params) -> Detectors:
    """The detectors that are enabled by these parameters."""
    return detectors if params.detection.far_view else replace(detectors, far=None)


def _ticks(source: LiveSource, params: Params, live: LiveDetectors, on_silence: Callable[[], None]) -> Iterator[Frame]:
    source.start()
    try:
        while True:
            frame = live.next_tick(source, _SILENCE_S, params)
            if frame is not None:
                yield frame
            else:
                on_silence()
    finally:
        source.close()
