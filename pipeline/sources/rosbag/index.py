"""Indexes a bag in one pass: when every message of the chosen topics was measured, by its header, and where to read it
again. The index takes 16 bytes per message, whatever the bag's size."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np

from pipeline.common.nearest_in_time import Times
from pipeline.common.progress import Progress, silent
from pipeline.formats.velodyne import VLP16, DecoderCounts, Rotation, RotationCutter, SensorClock, model_of
from pipeline.sources.rosbag import messages
from pipeline.sources.rosbag.bag import Bag, BagError
from pipeline.sources.rosbag.rig import TF_STATIC, TransformTree
from pipeline.sources.rosbag.topics import TopicMap
from pipeline.types import EgoState, GnssFix

_TELL_EVERY = 64
"""Messages between two progress reports."""


class TopicIndex:
    """times_ns: (N,) ascending, from each message's header. recorded_ns: (N,), recording times, used to find the
    messages."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.frame_id = ""
        self.without_header = 0
        self._times, self._recorded = array("q"), array("q")

    def add(self, message: Any, recorded_ns: int) -> None:
        """Add a message by its own time."""
        t_ns, has_one = messages.stamp_ns(message, recorded_ns)
        self.without_header += not has_one
        self.frame_id = self.frame_id or str(getattr(getattr(message, "header", None), "frame_id", ""))
        self.add_time(t_ns, recorded_ns)

    def add_time(self, t_ns: int, recorded_ns: int) -> None:
        self._times.append(t_ns)
        self._recorded.append(recorded_ns)

    def sort(self) -> None:
        times = np.frombuffer(self._times, dtype=np.int64) if self._times else np.empty(0, np.int64)
        order = np.argsort(times, kind="stable")
        recorded = np.frombuffer(self._recorded, dtype=np.int64) if self._recorded else np.empty(0, np.int64)
        self.times_ns: Times = times[order]
        self.recorded_ns: Times = recorded[order]


class BagIndex:
    """Results of the pass. damage: why it ended before the end of the bag, None if it did not."""

    def __init__(self, bag: Bag, topics: TopicMap, progress: Progress = silent) -> None:
        self.damage: str | None = None
        self.lidar = TopicIndex(topics.lidar) if topics.lidar else None
        self.camera = TopicIndex(topics.camera) if topics.camera else None
        self.tree, self.camera_info = TransformTree(), None
        self.fixes: list[GnssFix] = []
        self.own: list[EgoState] = []
        self.counts: DecoderCounts | None = None
        self.model = VLP16
        self._topics = topics
        self._read_rig(bag)
        self.is_packets = self.lidar is not None and bag.topics[self.lidar.topic].kind == "VelodyneScan"
        self._cutter: RotationCutter | None = None
        wanted = [name for name in (topics.lidar, topics.camera, topics.gnss, topics.odometry) if name]
        try:
            total = sum(bag.topics[name].held for name in wanted)
            for done, (topic, recorded_ns, message) in enumerate(bag.messages(wanted)):
                if done % _TELL_EVERY == 0:
                    progress(done, total)
                self._add(topic, recorded_ns, message)
        except BagError as error:
            self.damage = str(error)
        if self._cutter is not None:
            self._add_rotation(self._cutter.flush())
        for stream in (self.lidar, self.camera):
            if stream is not None:
                stream.sort()

    def _read_rig(self, bag: Bag) -> None:
        try:
            for _, _, message in bag.messages([TF_STATIC]):
                self.tree.add(message)
            if self._topics.camera_info is not None:
                self.camera_info = next((m for _, _, m in bag.messages([self._topics.camera_info])), None)
        except BagError as error:
            self.damage = str(error)

    def _add(self, topic: str, recorded_ns: int, message: Any) -> None:
        if topic == self._topics.lidar and self.lidar is not None:
            if self.is_packets:
                self._add_packets(message, recorded_ns)
            else:
                self.lidar.add(message, recorded_ns)
        elif topic == self._topics.camera and self.camera is not None:
            self.camera.add(message, recorded_ns)
        elif topic == self._topics.gnss:
            t_ns, _ = messages.stamp_ns(message, recorded_ns)
            fix = messages.fix(message, t_ns, self.fixes[-1] if self.fixes else None)
            self.fixes += [fix] if fix is not None else []
        elif topic == self._topics.odometry:
            t_ns, _ = messages.stamp_ns(message, recorded_ns)
            try:
                self.own.append(messages.own_motion(message, t_ns))
            except messages.BadMessage:
                return

    def _add_packets(self, message: Any, recorded_ns: int) -> None:
        """Sweeps are cut behind the car again: each is found by the message that contains its first packet."""
        assert self.lidar is not None
        if self._cutter is None:
            self.lidar.frame_id = str(message.header.frame_id)
            self.model = model_of(data for data, _ in messages.packets(message))
            mount = self.tree.T_ego_lidar(self.lidar.frame_id)
            self._cutter = RotationCutter(mount, SensorClock(), model=self.model)
            self.counts = self._cutter.counts
        for data, received_ns in messages.packets(message):
            self._add_rotation(self._cutter.push(data, received_ns or recorded_ns, recorded_ns))

    def _add_rotation(self, rotation: Rotation | None) -> None:
        if rotation is not None and self.lidar is not None:
            self.lidar.add_time(rotation.t_ns, min(placed.origin for placed in rotation.packets))
