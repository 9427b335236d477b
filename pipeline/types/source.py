"""The protocols of recordings and live sensors: a source provides frames, in the ego frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeGuard, runtime_checkable

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.common.progress import Progress, silent
from pipeline.params import SyncParams
from pipeline.source_kinds import is_live
from pipeline.types import F64, Box, CameraCalibration, EgoState, Frame, GnssFix, StreamHealth, Sweep
from pipeline.types.camera_shot import Shot


class SourceError(BadInput):
    """A source that cannot be opened. The text is one sentence: what is wrong and with which file."""


@dataclass(frozen=True)
class TruthObject:
    """One labelled object."""

    label: str
    """Its class."""
    cuboid: Cuboid
    """In the ego frame."""
    id: int | None = None
    """Id of the object, stable from frame to frame; None where the labels follow no identity over time."""
    bbox: Box | None = None
    """Pixels of the raw image; None where the labels have no box."""
    called: str = ""
    """The labels' own word for the class where it differs from ``label``, so that it can be written again."""
    truncation: float | None = None
    """The share of it outside the image, 0–1; None where the labels do not say it."""
    occlusion: int | None = None
    """0 visible, 1 partly, 2 largely hidden; None where the labels do not say it."""


class Source(Protocol):
    """A recording with random access.

    Reading a frame never raises for what is wrong with that frame's data: the missing branch is None and
    ``Frame.notes`` says why. Several threads may read at once: playback and background runs share one source.
    """

    uri: str
    """What was opened, as the user typed it."""
    title: str
    """Short, for a heading."""
    rate_hz: float
    """Nominal frames per second."""
    notes: tuple[str, ...]
    """What a user should know about the whole recording, for example how many rings remain."""

    def __len__(self) -> int: ...

    def frame(self, index: int) -> Frame:
        """Frame ``index`` of 0 … len−1, without ``raw_boxes`` unless detections are given with it. IndexError
        outside."""
        ...

    def t_ns(self, index: int) -> int:
        """The tick of a frame, without reading its data."""
        ...

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        """The labelled objects, empty when the frame is labelled and holds none; None when it is not labelled."""
        ...


class Tap(Protocol):
    """Receives every message of live sensors, whether or not a tick uses it.

    Called on the thread that reads the sensor, so it must be quick. A frame's sweep shares its points with the sweep
    that was passed here. t_ns: when the data was measured; arrived_ns: when it arrived; both on the source's timeline.
    """

    def packet(self, payload: bytes, arrived_ns: int) -> object:
        """A data packet of the LiDAR."""
        ...

    def sweep(self, sweep: Sweep, arrived_ns: int) -> object: ...
    def image(self, shot: Shot, t_ns: int, arrived_ns: int) -> object: ...
    def ego(self, ego: EgoState, arrived_ns: int) -> object: ...
    def fix(self, fix: GnssFix, arrived_ns: int) -> object: ...


class LiveSource(Protocol):
    """Live sensors. There is no way back: ticks that are not taken in time are dropped and counted."""

    uri: str
    """What was opened, as the user typed it."""
    title: str
    """Short, for a heading."""
    rate_hz: float
    """Nominal ticks per second."""
    notes: tuple[str, ...]
    """What a user should know about all of it; what is wrong with one tick is in ``Frame.notes``."""
    camera: CameraCalibration | None
    """Calibration of the images; None without one."""
    dropped: int
    """Ticks that were not taken in time."""

    def start(self) -> None:
        """Open the devices. One that is not available yet is retried in the background."""
        ...

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        """The newest tick not returned yet; None when none arrives in time. A tick is a whole LiDAR sweep with the
        nearest image, or an image alone while the LiDAR is silent. params: how sensors are synchronised."""
        ...

    @property
    def lidar_mount(self) -> tuple[F64, int] | None:
        """T_ego_lidar (4, 4) and what is added to the LiDAR's timestamps in ns; None without a LiDAR."""
        ...

    def tap(self, tap: Tap | None) -> None:
        """Pass every message to ``tap`` from now on; None ends that."""
        ...

    def now_ns(self) -> int:
        """Now on the steady timeline that frames' times are on; setting the host's clock moves nothing on it."""
        ...

    def health(self) -> tuple[StreamHealth, ...]:
        """Health of each sensor now, also while none delivers."""
        ...

    def close(self) -> None:
        """Release the devices. Safe to call twice."""
        ...


@runtime_checkable
class Recorded(Protocol):
    """A source made from another one."""

    origin: str
    """The other one's URI."""


class Mark(NamedTuple):
    """A moment that someone marked during the recording."""

    t_ns: int
    """The tick of the frame."""
    text: str
    """What they wrote."""


@runtime_checkable
class Marked(Protocol):
    """A source with marks of its own."""

    def marks(self) -> tuple[Mark, ...]: ...


@runtime_checkable
class Rectified(Protocol):
    """A source with a camera frame of its own that its labels are in."""

    def T_rect_ego(self, index: int) -> F64:
        """(4, 4), takes ego points of a frame to KITTI's rectified camera 0."""
        ...


@runtime_checkable
class InParts(Protocol):
    """A source that can read parts of a frame without reading the rest."""

    def outlines(self) -> Iterator[Frame]:
        """Every frame, in order, without sweep, image, route and given detections, and without the notes that reading
        them would add."""
        ...

    def sweep(self, index: int) -> Sweep | None:
        """Only the sweep of a frame."""
        ...


@runtime_checkable
class RawPackets(Protocol):
    """A recording of the LiDAR's own packets."""

    def packets(self) -> Iterator[tuple[int, bytes]]:
        """Every data and position packet as it was captured: when (unix ns), and its payload."""
        ...


@runtime_checkable
class Mounted(Protocol):
    """A source whose LiDAR's mount a rig file says."""

    @property
    def T_ego_lidar(self) -> F64:
        """(4, 4), takes the LiDAR's own points to the ego frame."""
        ...


@runtime_checkable
class Simulated(Protocol):
    """A source that knows whether the simulator drew its images, which detectors of real images do worse on."""

    is_simulated: bool


AnySource = Source | LiveSource


@dataclass(frozen=True)
class Opening:
    """How a recording is to be opened. Each kind of source takes what concerns it."""

    rings: int = 16
    """How many rings to keep of a LiDAR that has more."""
    progress: Progress = silent
    """Told how much was read, where a whole file has to be."""


def is_live_source(source: AnySource) -> TypeGuard[LiveSource]:
    """Whether it is live sensors, which have no frames to choose from."""
    return is_live(source.uri)


def is_simulated(source: AnySource) -> bool:
    """Whether the simulator drew its images, also where they were recorded since."""
    return isinstance(source, Simulated) and source.is_simulated
