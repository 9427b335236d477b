"""The content of one message of ``/frames``: all data of a frame, the large parts by reference.

Viewers need Foxglove's schemas, which cannot hold all of a ``Frame`` exactly (a rotation becomes a quaternion, and
there is no field for a course). A tick therefore stores small values itself, number for number, and refers to the
messages of the point cloud, the image and the route by their log times, which are unique within a topic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from pipeline.formats.calibration_files.lens import LENGTHS
from pipeline.formats.file_reading import camera_matrix, rigid_transform
from pipeline.recording import topics
from pipeline.recording.errors import Damaged
from pipeline.recording.session.detections import Given
from pipeline.types import F64, CameraCalibration, EgoState, GnssFix, Route, StreamHealth
from pipeline.types.source import SourceError, TruthObject

_INT64 = 2**63
Nanoseconds = Annotated[int, Field(ge=-_INT64, lt=_INT64)]
_Size = Annotated[int, Field(ge=1, le=65536)]


@dataclass(frozen=True)
class SweepRef:
    """Reference to a point cloud stored as a separate message."""

    at_ns: Nanoseconds
    """Log time of the message."""
    t_ns: Nanoseconds
    """Its reference time, by the drive's clock."""
    channels: Annotated[int, Field(ge=1, le=255)]
    """Rings of the sensor."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Origin of the rays, ego x y z."""


@dataclass(frozen=True)
class ImageRef:
    """Reference to an image stored as a separate message."""

    at_ns: Nanoseconds
    """Log time of the message."""
    t_ns: Nanoseconds | None
    """Time of exposure; None if the camera gave no timestamp."""


@dataclass(frozen=True)
class ScanRef:
    """Reference to the scan of a further ranging sensor, stored as a separate message."""

    at_ns: Nanoseconds
    """Log time of the message."""
    t_ns: Nanoseconds
    """When it was measured, by the drive's clock."""


@dataclass(frozen=True)
class PacketsRef:
    """A sweep stored as the sensor's packets, received shortly before the tick."""

    t_ns: Nanoseconds
    """The sweep's timestamp: that of the decoder plus ``offset_ns``."""
    offset_ns: Nanoseconds
    """Added to the decoder's timestamps."""
    T_ego_lidar: tuple[float, ...]
    """(4, 4), row by row."""


def _known_distortion(values: tuple[float, ...]) -> tuple[float, ...]:
    if len(values) not in (0, *LENGTHS):
        raise ValueError(f"{len(values)} distortion coefficients")
    return values


@dataclass(frozen=True)
class CameraRecord:
    """``CameraCalibration`` with its matrices row by row."""

    at_ns: Nanoseconds
    """Log time of its messages in ``/camera/calibration`` and ``/tf``."""
    K: tuple[float, ...]
    """(3, 3), pixels."""
    distortion: Annotated[tuple[float, ...], AfterValidator(_known_distortion)]
    """OpenCV's coefficients; empty for none."""
    T_camera_ego: tuple[float, ...]
    """(4, 4), takes ego points to the camera frame."""
    width: _Size
    """Width of the images, pixels."""
    height: _Size
    """Height of the images, pixels."""
    road_z_m: float | None = None
    """Ego z of the road under the car; None where unknown."""

    @staticmethod
    def of(camera: CameraCalibration, at_ns: int) -> CameraRecord:
        def numbers(values: F64) -> tuple[float, ...]:
            return tuple(float(value) for value in values.ravel())

        matrices = numbers(camera.K), numbers(camera.distortion), numbers(camera.T_camera_ego)
        return CameraRecord(at_ns, *matrices, camera.width, camera.height, camera.road_z_m)

    def calibration(self) -> CameraCalibration:
        """Damaged if the matrices are not valid for a camera."""
        if len(self.K) != 9 or len(self.T_camera_ego) != 16:
            raise Damaged("the camera's calibration has a wrong shape")
        try:
            K = camera_matrix(np.reshape(self.K, (3, 3)), "calibration: K")
            T_camera_ego = rigid_transform(np.reshape(self.T_camera_ego, (4, 4)), "calibration: T_camera_ego")
        except SourceError as error:
            raise Damaged(str(error)) from None
        return CameraCalibration(K, np.array(self.distortion), T_camera_ego, self.width, self.height, self.road_z_m)


R = TypeVar("R", SweepRef | None, ImageRef | None, CameraRecord | None, ScanRef)


@dataclass(frozen=True)
class FrameRecord:
    """One frame of a session, as in ``Frame``."""

    name: str
    """Unique within the session."""
    t_ns: Nanoseconds
    """The tick."""
    notes: tuple[str, ...] = ()
    """What is missing and why."""
    sweep: SweepRef | None = None
    """None without one, or if it is stored as packets."""
    packets: PacketsRef | None = None
    """None unless the sweep is stored as packets."""
    picture: ImageRef | None = None
    """None without an image."""
    camera: CameraRecord | None = None
    """None without a calibration."""
    ego: EgoState | None = None
    """None if ego motion was not measured."""
    gnss: GnssFix | None = None
    """None without a fix."""
    streams: tuple[StreamHealth, ...] = ()
    """Health of live sensors; empty for a converted recording."""
    timing_ms: dict[str, float] = field(default_factory=dict)
    """By stage, from the run that recorded it."""
    route_at_ns: Nanoseconds | None = None
    """Log time of the planned route in ``/route``; None without one."""
    params_at_ns: Nanoseconds | None = None
    """Log time of the parameters in ``/params``; None if a session contains only inputs."""
    truth: tuple[TruthObject, ...] | None = None
    """Its labels; None if it is not labelled."""
    given: Given | None = None
    """Recorded detections; None if networks run again."""
    scans: dict[str, ScanRef] = field(default_factory=dict)
    """Of further ranging sensors, by ``SensorKind.name``."""

    def references(self) -> dict[str, int]:
        """Topic → log time of every other message that this tick needs."""
        named = {
            topics.POINTS: self.sweep.at_ns if self.sweep else None,
            topics.IMAGE: self.picture.at_ns if self.picture else None,
            topics.CALIBRATION: self.camera.at_ns if self.camera else None,
            topics.TF: self.camera.at_ns if self.camera else None,
            topics.ROUTE: self.route_at_ns,
            topics.PARAMS: self.params_at_ns,
            **{topics.scan_topic(sensor): ref.at_ns for sensor, ref in self.scans.items()},
        }
        return {topic: at_ns for topic, at_ns in named.items() if at_ns is not None}

    def moved(self, to_ns: Mapping[int, int]) -> FrameRecord:
        """The same tick after referenced messages were moved to new log times."""

        def at(before_ns: int | None) -> int | None:
            return None if before_ns is None else to_ns.get(before_ns, before_ns)

        def moved_ref(ref: R) -> R:
            return ref if ref is None else replace(ref, at_ns=to_ns.get(ref.at_ns, ref.at_ns))

        return replace(
            self,
            sweep=moved_ref(self.sweep),
            picture=moved_ref(self.picture),
            camera=moved_ref(self.camera),
            route_at_ns=at(self.route_at_ns),
            params_at_ns=at(self.params_at_ns),
            scans={sensor: moved_ref(ref) for sensor, ref in self.scans.items()},
        )


@dataclass(frozen=True)
class _RouteRecord:
    name: str
    lat_deg: tuple[float, ...]
    lon_deg: tuple[float, ...]
    sigma_m: float


_FRAME_RECORD, _ROUTE = TypeAdapter(FrameRecord), TypeAdapter(_RouteRecord)
_EGO, _STREAMS = TypeAdapter(EgoState), TypeAdapter(dict[str, tuple[StreamHealth, ...]])


def frame_record_message(tick: FrameRecord) -> bytes:
    """JSON. Non-finite numbers become null. Without scans, it does not mention them."""
    return _FRAME_RECORD.dump_json(tick, exclude=None if tick.scans else {"scans"})


def frame_record_from(data: bytes) -> FrameRecord:
    """Damaged if the message is not a tick."""
    try:
        return _FRAME_RECORD.validate_json(data)
    except ValidationError as error:
        raise Damaged(f"a message of /frames cannot be read: {error.errors()[0]['msg']}") from None


def ego_message(ego: EgoState) -> bytes:
    """An ego state as a message of the session."""
    return _EGO.dump_json(ego)


def health_message(streams: tuple[StreamHealth, ...]) -> bytes:
    """The health of the sensor streams as a message of the session."""
    return _STREAMS.dump_json({"streams": streams})


def route_message(route: Route) -> bytes:
    """A route as a message of the session, degrees and metres."""
    lat_deg, lon_deg = (tuple(map(float, values)) for values in (route.lat_deg, route.lon_deg))
    return _ROUTE.dump_json(_RouteRecord(route.name, lat_deg, lon_deg, route.sigma_m))


def route_from(data: bytes) -> Route:
    """Damaged if the message is not a route."""
    try:
        record = _ROUTE.validate_json(data)
    except ValidationError:
        raise Damaged("a message of /route cannot be read") from None
    if len(record.lat_deg) != len(record.lon_deg):
        raise Damaged("a message of /route cannot be read")
    return Route(record.name, np.array(record.lat_deg), np.array(record.lon_deg), record.sigma_m)
