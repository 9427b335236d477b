"""A ROS bag as a recording: one frame per LiDAR sweep (or per image without a LiDAR), with the times of message
headers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from itertools import islice
from threading import Lock
from typing import Any

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.nearest_in_time import Timeline, nearest
from pipeline.common.progress import Progress, silent
from pipeline.ego_motion.from_gnss import MotionFromGnss
from pipeline.formats.velodyne import VelodyneDecoder, about_other_models
from pipeline.sources import rig as rig_files
from pipeline.sources.rosbag import messages
from pipeline.sources.rosbag.bag import Bag, BagError, bag_path
from pipeline.sources.rosbag.index import BagIndex, TopicIndex
from pipeline.sources.rosbag.rig import calibration
from pipeline.sources.rosbag.topics import ROLES, map_topics, why_missing
from pipeline.sources.sidecar_files import FIX_WITHIN_NS, IMAGE_WITHIN_NS, rig_of
from pipeline.sources.uri_options import split_options
from pipeline.types import CameraCalibration, CameraImage, EgoState, Frame, Sweep
from pipeline.types.source import Opening, SourceError, TruthObject

_OWN_WITHIN_NS = 500_000_000
"""How long a message of odometry is used."""
_MESSAGES_A_SWEEP = 3
"""Messages of packets that a sweep may be spread over: drivers send one per rotation, cut anywhere."""


def open_recording(uri: str, rest: str, how: Opening) -> RosbagSource:
    """Loaded by name from ``pipeline.source_kinds``. SourceError if it cannot be opened."""
    return RosbagSource(uri, rest, how.progress)


class RosbagSource:
    """``<bag>?lidar=/topic&camera=/topic&camera_info=/topic&gnss=/topic&odometry=/topic&rig=file.yaml``: all optional;
    ``none`` disables a topic."""

    def __init__(self, uri: str, rest: str, progress: Progress = silent) -> None:
        path, options = split_options(rest, (*ROLES, "rig"))
        file = bag_path(path)
        self.uri, self.title = uri, file.resolve().stem
        self._bag, self._lock = Bag(file), Lock()
        topics = map_topics(self._bag.topics, options)
        if topics.lidar is None and topics.camera is None:
            raise SourceError(f"{path}: no LiDAR and no image topic; its topics are {_listed(self._bag)}")
        self._index = BagIndex(self._bag, topics, progress)
        self._ticks = self._ticking(path)
        notes = [topics.about(self._bag.topics), *self._about_times()]
        self._missing = {
            role: f"{name}: {why}"
            for role, name in (("lidar", "LiDAR"), ("camera", "camera"))
            if getattr(topics, role) is None and role not in options and (why := why_missing(role, self._bag.topics))
        }
        notes += self._missing.values()
        self._place(rig_of(file.resolve(), options), notes)
        self._own, self._fixes = self._own_motion(notes)
        if self._index.damage:
            notes.append(f"damaged: {self._index.damage}; everything before it is read")
        self.notes = tuple(notes)
        steps = np.diff(self._ticks.times_ns)
        self.rate_hz = round(1e9 / float(np.median(steps)), 2) if len(steps) and np.median(steps) > 0 else 10.0

    def __len__(self) -> int:
        return len(self._ticks.times_ns)

    def t_ns(self, index: int) -> int:
        if not 0 <= index < len(self):
            raise IndexError(f"frame {index} of {len(self)}")
        return int(self._ticks.times_ns[index])

    def frame(self, index: int) -> Frame:
        t_ns, notes = self.t_ns(index), list[str]()
        sweep = self._sweep(index, t_ns, notes)
        image = self._image(t_ns, notes)
        camera = rig_files.calibration_for(self._camera, image, notes)
        return evolve(self._outline(index, camera), sweep=sweep, image=image, notes=tuple(notes))

    def outlines(self) -> Iterator[Frame]:
        """All images of a camera have one size: the first one shows whether the calibration matches."""
        images = self._index.camera
        first = self._image(int(images.times_ns[0]), []) if images is not None and len(images.times_ns) else None
        camera = rig_files.calibration_for(self._camera, first, [])
        return (self._outline(index, camera) for index in range(len(self)))

    def sweep(self, index: int) -> Sweep | None:
        return self._sweep(index, self.t_ns(index), [])

    def _outline(self, index: int, camera: CameraCalibration | None) -> Frame:
        t_ns = self.t_ns(index)
        ego, gnss = self._own.latest(t_ns, _OWN_WITHIN_NS), self._fixes.latest(t_ns, FIX_WITHIN_NS)
        return Frame(index, f"{index:06d}", t_ns, camera=camera, ego=ego, gnss=gnss)

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        self.t_ns(index)
        return None

    def _ticking(self, path: str) -> TopicIndex:
        """The LiDAR's messages; the camera's if it has none."""
        for stream in (self._index.lidar, self._index.camera):
            if stream is not None and len(stream.times_ns):
                return stream
        counts = self._index.counts
        if counts is not None and counts.models:
            raise SourceError(f"{path}: {about_other_models(counts.models)}")
        why = self._index.damage or (counts.about_refused() if counts is not None else "")
        raise SourceError(f"{path}: no complete sweep or image{'; ' + why if why else ''}")

    def _place(self, rig: rig_files.Rig, notes: list[str]) -> None:
        """Mounts of the sensors: from a rig file, else from the bag."""
        index, lidar = self._index, self._index.lidar
        frame_id = lidar.frame_id if lidar is not None else ""
        mounted = rig.lidar.mount.T_ego_sensor()
        self.T_ego_lidar = index.tree.T_ego_lidar(frame_id) if np.array_equal(mounted, np.eye(4)) else mounted
        self._camera: CameraCalibration | None = rig.camera_calibration()
        if self._camera is None and index.camera is not None:
            if index.camera_info is None:
                notes.append("no CameraInfo: LiDAR and camera are not fused")
            else:
                self._camera = calibration(index.camera_info, index.tree, frame_id, self.T_ego_lidar, notes)

    def _own_motion(self, notes: list[str]) -> tuple[Timeline[EgoState], Timeline[Any]]:
        """Own speed from odometry, else from GNSS."""
        own, fixes = self._index.own, self._index.fixes
        if not own and fixes:
            follow = MotionFromGnss()
            own = [follow.push(fix) for fix in sorted(fixes, key=lambda fix: fix.t_ns)]
            notes.append("ego speed from GNSS positions")
        if not own:
            notes.append("no ego speed recorded")
        return Timeline([each.t_ns for each in own], own), Timeline([fix.t_ns for fix in fixes], fixes)

    def _about_times(self) -> list[str]:
        notes = []
        for role, stream in (("LiDAR", self._index.lidar), ("camera", self._index.camera)):
            if stream is not None and stream.without_header:
                notes.append(
                    f"{role}: {stream.without_header} messages without a timestamp: their recording time is used"
                )
        counts = self._index.counts
        if counts is not None:
            notes.append(
                "LiDAR packets are split into sweeps behind the car; times follow the sensor's clock, "
                "set by the driver's stamps"
            )
            notes += [counts.about_refused()] if counts.refused else []
            notes += [f"{counts.lost} packets lost"] if counts.lost else []
        return notes

    def _sweep(self, index: int, t_ns: int, notes: list[str]) -> Sweep | None:
        lidar = self._index.lidar
        if lidar is None:
            notes += [self._missing["lidar"]] if "lidar" in self._missing else []
            return None
        if lidar is not self._ticks:
            notes.append("LiDAR: no complete sweep in the bag")
            return None
        recorded_ns = int(lidar.recorded_ns[index])
        try:
            if self._index.is_packets:
                return self._packets_sweep(recorded_ns, t_ns, notes)
            message = self._message(lidar, recorded_ns, t_ns)
            if message is not None:
                return messages.cloud(message, t_ns, notes).sweep(t_ns, self.T_ego_lidar)
            notes.append("LiDAR: its message is missing")
        except (BagError, messages.BadMessage) as error:
            notes.append(f"LiDAR: {error}")
        return None

    def _packets_sweep(self, recorded_ns: int, t_ns: int, notes: list[str]) -> Sweep | None:
        """The sweep from the packets in the message that contains its first packet, and in those after it."""
        lidar = self._index.lidar
        assert lidar is not None
        decoder, found = VelodyneDecoder(self.T_ego_lidar, keeps_partial=True, model=self._index.model), list[Sweep]()
        with self._lock, closing(self._bag.messages([lidar.topic], recorded_ns, onward=True)) as read:
            scans = list(islice(read, _MESSAGES_A_SWEEP))
        for _, at_ns, message in scans:
            for data, received_ns in messages.packets(message):
                sweep = decoder.push(data, received_ns or at_ns)
                found += [sweep] if sweep is not None else []
        last = decoder.flush()
        found += [last] if last is not None else []
        sweep = min(found, key=lambda sweep: abs(sweep.t_ns - t_ns), default=None)
        if sweep is None:
            notes.append(f"LiDAR: no points; {decoder.counts.about_refused()}")
            return None
        return evolve(sweep, t_ns=t_ns)

    def _image(self, t_ns: int, notes: list[str]) -> CameraImage | None:
        camera = self._index.camera
        if camera is None:
            notes += [self._missing["camera"]] if "camera" in self._missing else []
            return None
        index = nearest(camera.times_ns, t_ns, IMAGE_WITHIN_NS)
        if index is None:
            notes.append("no image within 0.1 s")
            return None
        wanted_ns = int(camera.times_ns[index])
        try:
            message = self._message(camera, int(camera.recorded_ns[index]), wanted_ns)
            if message is not None:
                return messages.image(message, wanted_ns)
            notes.append("camera: its message is missing")
        except (BagError, messages.BadMessage) as error:
            notes.append(f"camera: {error}")
        return None

    def _message(self, stream: TopicIndex, recorded_ns: int, t_ns: int) -> Any:
        """The message recorded at this time with this timestamp; None if there is none. BagError if the bag is damaged
        there."""
        # a bag can be read at only one position at a time
        with self._lock, closing(self._bag.messages([stream.topic], recorded_ns)) as found:
            for _, at_ns, message in found:
                if messages.stamp_ns(message, at_ns)[0] == t_ns:
                    return message
        return None


def _listed(bag: Bag) -> str:
    return ", ".join(f"{topic.name} ({topic.kind})" for topic in bag.topics.values()) or "none"
