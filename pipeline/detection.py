"""Runs the detectors on the images of a source. Networks run here, before ``step``, and nowhere else: their outputs are
part of the frame and can be cached, so changing a parameter never waits for a network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar, cast

from pipeline.inference.model_registry import EMBEDDED
from pipeline.inference.runtime import DetectorMissing
from pipeline.lanes.network import LaneNetwork
from pipeline.lanes.open_detector import LaneDetector, open_lanes, usual_every
from pipeline.types import U8, CameraCalibration, Frame, RawBoxes, RawLanes
from pipeline.types.source import AnySource, Source, is_live_source, is_simulated
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.far_view import WINDOW_PX, FarView, open_far_view

Seen = TypeVar("Seen", RawBoxes, RawLanes)
Seen_co = TypeVar("Seen_co", bound=RawBoxes | RawLanes, covariant=True)


class Detects(Protocol[Seen_co]):
    """Processes one image: a network, or anything with the same interface."""

    @property
    def name(self) -> str:
        """Equal names give equal outputs; used as cache key."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know about it, in sentences."""
        ...

    def detect(self, bgr: U8) -> Seen_co:
        """The detections in an image (H, W, 3) uint8."""
        ...


@dataclass(frozen=True)
class Detectors:
    """The detectors of a recording. For live sensors wrap them in
    ``pipeline.live_detection.LiveDetectors``."""

    boxes: Detects[RawBoxes] | None = None
    """Finds vehicles; None without a detector."""
    lanes: Detects[RawLanes] | None = None
    """Finds lane lines; None without a detector."""
    lanes_every: int = 1
    """Lane lines are detected in every n-th frame by its index, so the results do not depend on the order in which
    frames are read. In between, the lane tracker predicts."""
    far: FarView | None = None
    """Processes the far part of the image a second time; None without a second pass."""
    far_every: int = 1
    """The far view runs in every n-th frame by its index."""
    far_lanes: Detects[RawLanes] | None = None
    """Takes every second turn of ``lanes``, for the far part of the image only; None: ``lanes`` takes every turn."""
    left_out: tuple[str, ...] = ()
    """What does not run because the machine is too slow, as notes of the frame."""

    def lanes_of(self, index: int) -> Detects[RawLanes] | None:
        """The lane detector that processes the frame with this index; None if it is nobody's turn."""
        turn, rest = divmod(index, self.lanes_every)
        return self.lanes_in_turn(turn) if rest == 0 else None

    def lanes_in_turn(self, turn: int) -> Detects[RawLanes] | None:
        """The lane detector whose turn it is: whole images and their far part alternate."""
        return self.far_lanes if self.far_lanes is not None and turn % 2 == 1 else self.lanes

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all detectors: equal names give equal outputs."""
        asked = (self.boxes, self.lanes, self.far_lanes, self.far)
        return tuple(each.name for each in asked if each is not None)

    def looks_far(self, index: int) -> bool:
        """Whether the far view runs in the frame with this index."""
        return self.far is not None and index % self.far_every == 0


class Look(Protocol):
    """How a detector is called for a frame's image: directly, or through a cache."""

    def __call__(self, detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen: ...


def look(detector: Detects[Seen], frame: Frame, bgr: U8) -> Seen:
    """Call the detector directly."""
    return detector.detect(bgr)


def detect(frame: Frame, detectors: Detectors, ask: Look = look) -> Frame:
    """The frame with the detections in its image. A frame without an image, or whose recording already contains
    detections, is returned unchanged."""
    if frame.image is None or frame.detections_given:
        return frame
    bgr = frame.image.bgr
    if detectors.left_out:
        frame = replace(frame, notes=(*frame.notes, *detectors.left_out))
    if detectors.boxes is not None:
        frame = replace(frame, raw_boxes=ask(detectors.boxes, frame, bgr))
    if detectors.far is not None and detectors.looks_far(frame.index):
        far = ask(detectors.far.of(frame), frame, bgr)
        whole = frame.raw_boxes
        frame = replace(frame, raw_boxes=detectors.far.added_to(whole, far) if whole is not None else far)
    lanes = detectors.lanes_of(frame.index)
    if lanes is not None:
        frame = replace(frame, raw_lanes=ask(lanes, frame, bgr))
    return frame


def detector_for(source: AnySource, spec: str | None = None) -> Detector:
    """The named vehicle detector, with an input size that fits the source's images. Without a name: the embedded
    network for the simulator, whose images it was trained on; the default network for everything else.

    Raises DetectorMissing if it is not installed, DetectorError if it cannot be run.
    """
    if spec is None and is_simulated(source):
        spec = EMBEDDED
    return open_detector(spec, image_size(source))


def far_view_for(
    source: AnySource, detector: Detects[RawBoxes] | None, far_px: int | None = WINDOW_PX
) -> FarView | None:
    """The far view with the same network for the source's images. None without a network, with ``far_px`` None, or if
    the images are no larger than the network's input. DetectorError if the network cannot be run at that size."""
    size = image_size(source)
    if far_px is None or size is None or not isinstance(detector, Detector):
        return None
    return open_far_view(detector, size, far_px)


def lanes_for(source: AnySource, spec: str | None = None) -> LaneDetector | None:
    """The lane detector for the source's images (``pipeline.lanes.open_detector.open_lanes``). None for a source
    without images, unless a detector is named."""
    if spec is None and image_size(source) is None:
        return None
    return open_lanes(spec, camera_of(source), is_simulated(source))


def far_lanes_for(
    camera: CameraCalibration | None, lanes: object, far_px: int | None = WINDOW_PX
) -> LaneNetwork | None:
    """The same lane network for the far part of a camera's images, whose size depends on the camera alone. None without
    a network, with ``far_px`` None, which switches off every far view, or if the whole image shows as much."""
    return lanes.far_of(camera) if far_px is not None and isinstance(lanes, LaneNetwork) else None


def camera_of(source: AnySource) -> CameraCalibration | None:
    """The calibration of the source's images: of the first frame of a recording; None if it is not known."""
    return source.camera if is_live_source(source) else cast("Source", source).frame(0).camera


def brings_detections(source: AnySource) -> bool:
    """Whether a recording contains the detections of its images, so that no detector is needed."""
    return not is_live_source(source) and cast("Source", source).frame(0).detections_given


def image_size(source: AnySource) -> tuple[int, int] | None:
    """(width, height) of the source's images: from the first frame of a recording, from the calibration of live
    sensors. None without image and calibration."""
    if is_live_source(source):
        return (source.camera.width, source.camera.height) if source.camera is not None else None
    return cast("Source", source).frame(0).image_size


@dataclass(frozen=True)
class DetectorChoice:
    """The detectors chosen by the user."""

    boxes: str | None = None
    """Name or path of the vehicle detector; None for the default."""
    lanes: str | None = None
    """Name or path of the lane network, ``classical`` or ``off``; None for the default."""
    lanes_every: int | None = None
    """Lanes are detected in every n-th frame; None for a default that depends on the lane detector's speed."""
    far_px: int | None = WINDOW_PX
    """Side of the far view's window in native pixels; None without a far view, for lanes as well."""


def open_detectors(
    source: AnySource, choice: DetectorChoice, sensors: str = "both", say: Callable[[str], object] = lambda _: None
) -> Detectors:
    """All detectors for the source's images: none for LiDAR alone, and for recordings that contain detections.

    say: receives sentences that a user should know about them. DetectorMissing if a named detector is missing, or any
    detector with ``sensors="camera"``; otherwise this is reported through ``say`` and only the LiDAR is used.
    """
    if sensors == "lidar" or brings_detections(source):
        return Detectors()
    lanes = lanes_for(source, choice.lanes)
    for note in lanes.notes if lanes is not None else ():
        say(note)
    boxes = open_boxes(source, choice.boxes, sensors, say)
    every = choice.lanes_every or usual_every(lanes, source.rate_hz)
    far = far_view_for(source, boxes, choice.far_px)
    far_lanes = far_lanes_for(camera_of(source), lanes, choice.far_px)
    return Detectors(boxes, lanes, every, far, far_lanes=far_lanes)


def open_boxes(
    source: AnySource, spec: str | None, sensors: str = "both", say: Callable[[str], object] = lambda _: None
) -> Detector | None:
    """Only the vehicle detector, opened as in ``open_detectors``."""
    try:
        detector = detector_for(source, spec)
    except DetectorMissing as missing:
        if spec is not None or sensors == "camera":
            raise
        say(str(missing))
        return None
    for note in detector.notes:
        say(note)
    return detector
