"""Maps topics of a bag to sensors: guessed from message type, name and number of messages, or chosen by the user."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from pipeline.sources.rosbag.bag import Topic
from pipeline.types.source import SourceError

NONE = "none"
ROLES: dict[str, tuple[str, ...]] = {
    "lidar": ("PointCloud2", "VelodyneScan"),
    "camera": ("CompressedImage", "Image"),
    "camera_info": ("CameraInfo",),
    "gnss": ("NavSatFix",),
    "odometry": ("Odometry",),
}
"""Role → accepted message types."""
_LIKELY: dict[str, tuple[str, ...]] = {
    "lidar": ("velodyne", "lidar", "points_raw", "points"),
    "camera": ("front", "center", "image_raw", "color", "rgb"),
    "odometry": ("wheel", "vehicle", "odom"),
    "gnss": ("fix", "gnss", "gps"),
}
_UNLIKELY = ("depth", "thermal", "ir", "mask", "debug", "rear", "back", "left", "right", "filtered", "ground")


class TopicMap(NamedTuple):
    """Topic of each role; None if the bag has none."""

    lidar: str | None
    """Point clouds."""
    camera: str | None
    """Images, compressed or raw."""
    camera_info: str | None
    """Calibration of that camera."""
    gnss: str | None
    """Fixes."""
    odometry: str | None
    """Ego speed and yaw rate."""

    def about(self, topics: Mapping[str, Topic]) -> str:
        """``topics: lidar /velodyne_points (PointCloud2), …``."""
        parts = [f"{role} {name} ({topics[name].kind})" for role, name in self._asdict().items() if name]
        return f"topics: {', '.join(parts)}; choose others with ?lidar=/name&camera=…; `none` leaves one out"


def map_topics(topics: Mapping[str, Topic], wanted: Mapping[str, str]) -> TopicMap:
    """Each role's topic: the one given by the user, else the most likely one. SourceError for a topic that does not
    exist or has another type."""
    chosen: dict[str, str | None] = {}
    for role, kinds in ROLES.items():
        if role in wanted:
            chosen[role] = None if wanted[role] == NONE else _checked(role, wanted[role], topics)
        elif role == "camera_info":
            chosen[role] = _info_of(chosen["camera"], topics)
        else:
            fitting = [topic for topic in topics.values() if topic.kind in kinds and topic.held and topic.is_defined]
            chosen[role] = max(fitting, key=lambda topic: _rank(role, topic)).name if fitting else None
    return TopicMap(**chosen)


def why_missing(role: str, topics: Mapping[str, Topic]) -> str | None:
    """Why a role has no topic although the bag has topics of its types: they have no messages, or the message
    definition is missing, as with damaged metadata. None for a bag without such topics."""
    empty = sorted(topic.name for topic in topics.values() if topic.kind in ROLES[role] and not topic.held)
    unknown = sorted(f"{topic.name} ({topic.kind})" for topic in topics.values() if topic.held and not topic.is_defined)
    why = [f"no messages on {', '.join(empty)}"] if empty else []
    why += [f"messages of unknown types on {', '.join(unknown)}"] if unknown else []
    return "; ".join(why) or None


def _checked(role: str, name: str, topics: Mapping[str, Topic]) -> str:
    if name not in topics:
        raise SourceError(f"{role}={name}: no such topic; there are {', '.join(sorted(topics)) or 'none'}")
    if topics[name].kind not in ROLES[role]:
        raise SourceError(f"{role}={name}: its messages are {topics[name].kind}, not {' or '.join(ROLES[role])}")
    return name


def _rank(role: str, topic: Topic) -> tuple[int, int, int, int, str]:
    """Likely words in the name, no unlikely ones, order of types, number of messages; ties are resolved by name."""
    name = topic.name.lower()
    likely = sum(word in name for word in _LIKELY.get(role, ()))
    unlikely = sum(word in name.replace("_", "/").split("/") for word in _UNLIKELY)
    return likely - 2 * unlikely, -ROLES[role].index(topic.kind), topic.held, -len(name), name


def _info_of(camera: str | None, topics: Mapping[str, Topic]) -> str | None:
    """The ``CameraInfo`` for the images: ROS puts it into the same namespace."""
    infos = sorted(topic.name for topic in topics.values() if topic.kind == "CameraInfo" and topic.held)
    if camera is None or not infos:
        return None
    common = {info: len(_common(info.split("/"), camera.split("/"))) for info in infos}
    return max(infos, key=lambda info: common[info])


def _common(one: list[str], other: list[str]) -> list[str]:
    shared = []
    for a, b in zip(one, other, strict=False):
        if a != b:
            break
        shared.append(a)
    return shared
