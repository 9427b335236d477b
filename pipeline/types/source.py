"""The protocols of recordings and live sensors: a source provides frames, in the ego frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeGuard, runtime_checkable

from pipeline.common.errors import BadInput
from pipeline.common.geometry import Cuboid
from pipeline.common.progress import Progress, silent
from pipeline.params import Params, SyncParams
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
    """Id of the object, stable from frame to frame; None if the labels have no track ids."""
    bbox: Box | None = None
    """Pixels of the raw image; None where the labels have no box."""
    called: str = ""
    """Original class name in the labels if it differs from ``label``, so that it can be written back."""
    truncation: float | None = None
    """Share of the object outside the image, 0–1; None if the labels do not contain it."""
    occlusion: int | None = None
    """0 visible, 1 partly, 2 largely hidden; None if the labels do not contain it."""
    path_offset_m: float | None = None
    """Lateral distance of its centre from the way that the car takes, positive to the left; None where the recording
    does not tell that way as far as there."""


class Source(Protocol):
    """A recording with random access.

    Reading a frame never raises for damaged data in that frame: the missing branch is None and ``Frame.notes`` says
    why. Several threads may read at once: playback and background runs share one source.
    """

    uri: str
    """The address that was opened, as the user typed it."""
    title: str
    """Short, for a heading."""
    rate_hz: float
    """Nominal frames per second."""
    notes: tuple[str, ...]
    """What a user should know about the whole recording, for example how many rings remain."""

    def __len__(self) -> int: ...

    def frame(self, index: int) -> Frame:
        """Frame ``index`` of 0 … len−1, without ``raw_boxes`` unless the recording contains detections. IndexError
        outside this range."""
        ...

    def t_ns(self, index: int) -> int:
        """The tick of a frame, without reading its data."""
        ...

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        """The labelled objects; empty if the frame is labelled and has no objects, None if it is not labelled."""
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
    """Live sensors. They cannot be rewound: ticks that are not taken in time are dropped and counted."""

    uri: str
    """The address that was opened, as the user typed it."""
    title: str
    """Short, for a heading."""
    rate_hz: float
    """Nominal ticks per second."""
    notes: tuple[str, ...]
    """What a user should know about the whole source; problems of one tick are in ``Frame.notes``."""
    camera: CameraCalibration | None
    """Calibration of the images; None without one."""
    dropped: int
    """Ticks that were not taken in time."""

    def start(self) -> None:
        """Open the devices. A device that is not available yet is retried in the background."""
        ...

    def next(self, timeout_s: float, params: SyncParams | None = None) -> Frame | None:
        """The newest tick not returned yet; None when none arrives in time. A tick is a whole LiDAR sweep with the
        nearest image, or an image alone while the LiDAR is silent. params: how sensors are synchronised."""
        ...

    def upcoming(self, params: SyncParams | None = None) -> Frame | None:
        """The next tick without its sweep, as soon as its image is known, so that detectors can process that while the
        sweep is still being measured. The tick has the same array ``image.bgr``, unless its sweep is not at the
        expected time. None while the image is not known."""
        ...

    @property
    def lidar_mount(self) -> tuple[F64, int] | None:
        """T_ego_lidar (4, 4) and the offset in ns that is added to the LiDAR's timestamps; None without a LiDAR."""
        ...

    def tap(self, tap: Tap | None) -> None:
        """Pass every message to ``tap`` from now on; None stops that."""
        ...

    def now_ns(self) -> int:
        """Current time on the monotonic timeline of the frames' times; changing the host's clock does not affect it."""
        ...

    def health(self) -> tuple[StreamHealth, ...]:
        """Current health of each sensor, also while none delivers data."""
        ...

    def close(self) -> None:
        """Release the devices. Safe to call twice."""
        ...


@runtime_checkable
class Recorded(Protocol):
    """A source made from another source."""

    origin: str
    """URI of the original source."""


@runtime_checkable
class Parametrised(Protocol):
    """A source that stores the parameters it was recorded with."""

    def params(self, index: int) -> Params | None:
        """Parameters of a frame when it was recorded; None if they are not known."""
        ...


class Mark(NamedTuple):
    """A moment that a user marked during the recording."""

    t_ns: int
    """The tick of the frame."""
    text: str
    """The user's text."""


@runtime_checkable
class Marked(Protocol):
    """A source with its own marks."""

    def marks(self) -> tuple[Mark, ...]: ...


@runtime_checkable
class Rectified(Protocol):
    """A source whose labels are in its own camera frame."""

    def T_rect_ego(self, index: int) -> F64:
        """(4, 4), takes ego points of a frame to KITTI's rectified camera 0."""
        ...


@runtime_checkable
class InParts(Protocol):
    """A source that can read parts of a frame without reading the rest."""

    def outlines(self) -> Iterator[Frame]:
        """Every frame, in order, without sweep, image, route and recorded detections, and without the notes that
        reading these would add."""
        ...

    def sweep(self, index: int) -> Sweep | None:
        """Only the sweep of a frame."""
        ...


@runtime_checkable
class RawPackets(Protocol):
    """A recording of raw LiDAR packets."""

    def packets(self) -> Iterator[tuple[int, bytes]]:
        """Every data and position packet as captured: time (unix ns) and payload."""
        ...


@runtime_checkable
class Mounted(Protocol):
    """A source whose LiDAR mount comes from a rig file."""

    @property
    def T_ego_lidar(self) -> F64:
        """(4, 4), takes the LiDAR's own points to the ego frame."""
        ...


@runtime_checkable
class StoresOtherLidarFrame(Protocol):
    """A recording whose files hold LiDAR points in another frame than the ego frame, which it turns them to."""

    @property
    def T_ego_stored(self) -> F64:
        """(4, 4), takes points as they are in the files to the ego frame."""
        ...


def lidar_frame(source: Source | LiveSource | None) -> F64 | None:
    """(4, 4) T_ego_lidar, from the frame in which the sensor or the recording's files give points, to the ego frame;
    None where the two are the same. Other tools' calibrations relate to the LiDAR's frame."""
    if source is None:
        return None
    if isinstance(source, Mounted):
        return source.T_ego_lidar
    if isinstance(source, StoresOtherLidarFrame):
        return source.T_ego_stored
    if is_live_source(source) and source.lidar_mount is not None:
        return source.lidar_mount[0]
    return None


@runtime_checkable
class Simulated(Protocol):
    """A source that knows whether its images are from the simulator; detectors of real images perform worse on
    these."""

    is_simulated: bool


AnySource = Source | LiveSource


@dataclass(frozen=True)
class Opening:
    """Options for opening a recording. Each kind of source uses those that apply to it."""

    rings: int = 16
    """How many rings to keep if the LiDAR has more."""
    progress: Progress = silent
    """Receives the reading progress if a whole file must be read."""


def is_live_source(source: AnySource) -> TypeGuard[LiveSource]:
    """Whether these are live sensors, which have no random access."""
    return is_live(source.uri)


def is_simulated(source: AnySource) -> bool:
    """Whether the images are from the simulator, including recordings of simulated drives."""
    return isinstance(source, Simulated) and source.is_simulated
