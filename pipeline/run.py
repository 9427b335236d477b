"""source → detectors → step: every frame of a recording, in order, with its result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, Protocol, TypeVar, cast

from pipeline.inference.model_registry import EMBEDDED
from pipeline.lanes.open_detector import LaneDetector, open_lanes
from pipeline.params import Params
from pipeline.step import State, step, warm_up
from pipeline.types import U8, Frame, RawBoxes, RawLanes, Result
from pipeline.types.source import AnySource, LiveSource, Source, is_live_source, is_simulated
from pipeline.vision.detector import Detector, open_detector

_SILENCE_S = 0.5

Sensors = Literal["lidar", "camera", "both"]
Seen = TypeVar("Seen", RawBoxes, RawLanes)
Seen_co = TypeVar("Seen_co", bound=RawBoxes | RawLanes, covariant=True)


class Detects(Protocol[Seen_co]):
    """Looks at one picture. name: equal names give equal answers, the key of caches. notes: what a person should know
    about it."""

    @property
    def name(self) -> str: ...

    @property
    def notes(self) -> tuple[str, ...]: ...

    def detect(self, bgr: U8) -> Seen_co:
        """What is in a picture (H, W, 3) uint8."""
        ...


@dataclass(frozen=True)
class Detectors:
    """What looks at the pictures before the line runs; null: nothing does.

    boxes: finds vehicles. lanes: finds lane lines, in every ``lanes_every``-th frame of a recording, whatever the
    order they are asked for in; between, the lane tracker counts their age. Of live sensors see ``LiveDetectors``.
    """

    boxes: Detects[RawBoxes] | None = None
    lanes: Detects[RawLanes] | None = None
    lanes_every: int = 1

    def looks_for_lanes(self, index: int) -> bool:
        """Whether a frame is one of those."""
        return self.lanes is not None and index % self.lanes_every == 0


class LiveDetectors:
    """Detectors for each tick of live sensors that is run, in turn. The lanes' turn comes when ``lanes_every`` ticks
    were run since their last one: an index also counts ticks that were dropped, so its rhythm would be that of the
    drops."""

    def __init__(self, detectors: Detectors) -> None:
        self._detectors = detectors
        self._since_lanes = detectors.lanes_every

    def of(self, frame: Frame) -> Detectors:
        """To be asked once for each tick. A lanes' turn without a picture passes to the next tick."""
        is_due = self._since_lanes >= self._detectors.lanes_every and frame.picture is not None
        self._since_lanes = 1 if is_due else self._since_lanes + 1
        return replace(self._detectors, lanes=self._detectors.lanes if is_due else None, lanes_every=1)


class Look(Protocol):
    """How a detector is asked about a frame's picture: straight away, or through a cache."""

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen: ...


def look(detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
    """Ask straight away."""
    return detector.detect(bgr)


def detector_for(source: AnySource, spec: str | None = None) -> Detector:
    """The named network, its input fitted to the source's pictures. Without a name: the embedded one for the
    simulator, which it was trained on and where a network for real pictures does worse; else the default one.

    DetectorMissing when there is none, DetectorError when it cannot be run.
    """
    if spec is None and is_simulated(source):
        spec = EMBEDDED
    return open_detector(spec, picture_size(source))


def lanes_for(source: AnySource, spec: str | None = None) -> LaneDetector | None:
    """The lane detector for the source's pictures, as ``pipeline.lanes.open_detector.open_lanes`` chooses it. None for
    a source that has no pictures, unless one is named."""
    if spec is None and picture_size(source) is None:
        return None
    camera = source.camera if is_live_source(source) else cast("Source", source).frame(0).camera
    return open_lanes(spec, camera, is_simulated(source))


def brings_detections(source: AnySource) -> bool:
    """Whether what is seen in a recording's pictures comes with them, so that nothing has to look."""
    return not is_live_source(source) and cast("Source", source).frame(0).detections_given


def picture_size(source: AnySource) -> tuple[int, int] | None:
    """(width, height) of the source's pictures, from its first frame, of live ones from the calibration; null without
    picture and calibration."""
    if is_live_source(source):
        return (source.camera.width, source.camera.height) if source.camera is not None else None
    frame = cast("Source", source).frame(0)
    if frame.picture is not None:
        return frame.picture.bgr.shape[1], frame.picture.bgr.shape[0]
    return (frame.camera.width, frame.camera.height) if frame.camera is not None else None


def detect(frame: Frame, detectors: Detectors, ask: Look = look) -> Frame:
    """The frame with what the detectors see in its picture. Networks run here and nowhere else."""
    if frame.picture is None or frame.detections_given:
        return frame
    bgr = frame.picture.bgr
    if detectors.boxes is not None:
        frame = replace(frame, raw_boxes=ask(detectors.boxes, frame, bgr))
    if detectors.lanes is not None and detectors.looks_for_lanes(frame.index):
        frame = replace(frame, raw_lanes=ask(detectors.lanes, frame, bgr))
    return frame


def only(frame: Frame, sensors: Sensors) -> Frame:
    """The frame as a car without the other sensor would have it. The picture stays: people still want to see it."""
    if sensors == "lidar":
        return replace(frame, raw_boxes=None, raw_lanes=None)
    if sensors == "camera":
        return replace(frame, sweep=None)
    return frame


def advance(
    state: State, frame: Frame, params: Params, detectors: Detectors, sensors: Sensors = "both", ask: Look = look
) -> tuple[Frame, State, Result]:
    """One frame as its source gave it through detectors and line: the frame that the line saw, the state after it and
    its result."""
    frame = only(frame if sensors == "lidar" else detect(frame, detectors, ask), sensors)
    state, result = step(state, frame, params)
    return frame, state, result


def run(
    source: Source, params: Params, detectors: Detectors, sensors: Sensors = "both"
) -> Iterator[tuple[Frame, Result]]:
    """Each frame of a recording with its result. Without detectors LiDAR goes on alone."""
    return through((source.frame(index) for index in range(len(source))), params, detectors, sensors)


def run_live(
    source: LiveSource,
    params: Params,
    detectors: Detectors,
    sensors: Sensors = "both",
    on_silence: Callable[[], None] = lambda: None,
) -> Iterator[tuple[Frame, Result]]:
    """Each tick with its result, the newest only, for as long as it is asked for; the sensors are given back then.
    on_silence: called while no sensor ticks, every half second."""
    return _through(_ticks(source, params, on_silence), params, LiveDetectors(detectors).of, sensors)


def through(
    frames: Iterable[Frame], params: Params, detectors: Detectors, sensors: Sensors = "both"
) -> Iterator[tuple[Frame, Result]]:
    """Each frame through the line, one after the other."""
    return _through(frames, params, lambda _: detectors, sensors)


def _through(
    frames: Iterable[Frame], params: Params, detectors_of: Callable[[Frame], Detectors], sensors: Sensors
) -> Iterator[tuple[Frame, Result]]:
    warm_up()
    state = State()
    for frame in frames:
        seen, state, result = advance(state, frame, params, detectors_of(frame), sensors)
        yield seen, result


def _ticks(source: LiveSource, params: Params, on_silence: Callable[[], None]) -> Iterator[Frame]:
    source.start()
    try:
        while True:
            frame = source.next(_SILENCE_S, params.sync)
            if frame is not None:
                yield frame
            else:
                on_silence()
    finally:
        source.close()
