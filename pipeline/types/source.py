"""The one protocol behind every recording and device: a source gives frames, by index, in the ego frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeGuard, runtime_checkable

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.params import SyncParams
from pipeline.types import F64, Box, CameraCalibration, EgoState, Frame, GnssFix, StreamHealth, Sweep
from pipeline.types.camera_shot import Shot

LIVE = "live:"
"""Scheme of what is read from devices."""


class SourceError(BadInput):
    """A source that cannot be opened. The text is one sentence for a person: what is wrong and with which file."""


@dataclass(frozen=True)
class TruthObject:
    """One labelled object, ego frame. ``id`` is null where the labels follow no identity over time. bbox: in pixels of
    the raw picture, null where the labels have none. called: the labels' own word where ``label`` is another one, which
    would not be written as that word again."""

    label: str
    cuboid: Cuboid
    id: int | None = None
    bbox: Box | None = None
    called: str = ""


class Source(Protocol):
    """A recording that can be read anywhere. Reading a frame never raises for what is wrong with that frame's data:
    the missing branch is null and ``Frame.notes`` says why. Any thread, and several at once: what is shown and what is
    computed beside it are read from one.

    uri: what was opened, as a person typed it. title: short, for a heading. rate_hz: nominal frames per second.
    notes: what a person should know about the whole (for example how many rings remain).
    """

    uri: str
    title: str
    rate_hz: float
    notes: tuple[str, ...]

    def __len__(self) -> int: ...

    def frame(self, index: int) -> Frame:
        """Frame ``index`` of 0 … len−1, without ``raw_boxes`` unless detections are given with it. IndexError
        outside."""
        ...

    def t_ns(self, index: int) -> int:
        """The tick of a frame, without reading its data."""
        ...

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        """The labelled objects, empty when the frame is labelled and holds none; null when it is not labelled."""
        ...


class Tap(Protocol):
    """Is told of everything that comes, whether or not a tick takes it, each on the thread of its reader: it must be
    quick. A frame's sweep has the very points that were told. t_ns: when it was measured; arrived_ns: when it came;
    both on the source's timeline."""

    def packet(self, payload: bytes, arrived_ns: int) -> object:
        """A data packet of the LiDAR."""
        ...

    def sweep(self, sweep: Sweep, arrived_ns: int) -> object: ...
    def picture(self, shot: Shot, t_ns: int, arrived_ns: int) -> object: ...
    def ego(self, ego: EgoState, arrived_ns: int) -> object: ...
    def fix(self, fix: GnssFix, arrived_ns: int) -> object: ...


class LiveSource(Protocol):
    """Devices that are read as they deliver. There is no way back: what nobody took in time is dropped and counted.

    notes: what a person should know about the whole, as with ``Source``; a frame's own troubles are in its notes.
    camera: calibration of the pictures, null without one. dropped: ticks that nobody took in time.
    """

    uri: str
    title: str
    rate_hz: float
    notes: tuple[str, ...]
    camera: CameraCalibration | None
    dropped: int

    def start(self) -> None:
        """Open the devices; one that is not there yet is waited for in the background."""
        ...

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        """The newest tick not given yet; null when none came in time. A tick is a whole LiDAR sweep with the nearest
        picture, or, while the LiDAR is silent, a picture. ``params``: how sensors are put together, as it stands."""
        ...

    @property
    def lidar_mount(self) -> tuple[F64, int] | None:
        """T_ego_lidar (4, 4) and what is added to the LiDAR's stamps in ns; null when there is none."""
        ...

    def tap(self, tap: Tap | None) -> None:
        """Have what comes told from now on; null ends that."""
        ...

    def now_ns(self) -> int:
        """Now on the steady timeline that frames' times are on; setting the host's clock moves nothing on it."""
        ...

    def health(self) -> tuple[StreamHealth, ...]:
        """How each sensor does now, also while none ticks."""
        ...

    def close(self) -> None:
        """Give the devices back. Safe to call twice."""
        ...


@runtime_checkable
class Recorded(Protocol):
    """A source that was made from another one. origin: that one's URI."""

    origin: str


class Mark(NamedTuple):
    """A moment that a person marked while it was recorded: the tick of the frame, and their words."""

    t_ns: int
    text: str


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
    """A source whose frames can be had in parts: who needs one part does not pay for all."""

    def outlines(self) -> Iterator[Frame]:
        """Every frame, in order, without sweep, picture, route and given detections, which need not be read, and
        without what reading them would note."""
        ...

    def sweep(self, index: int) -> Sweep | None:
        """The frame's alone."""
        ...


AnySource = Source | LiveSource


def is_live_source(source: AnySource) -> TypeGuard[LiveSource]:
    """Whether it is devices, which have no frames to choose from."""
    return source.uri.startswith(LIVE)


def is_simulated(source: AnySource) -> bool:
    """Whether its pictures are drawn, which a detector may have to know."""
    return (source.origin if isinstance(source, Recorded) else source.uri).startswith("sim:")
