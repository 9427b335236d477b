"""What damage of a ROS bag is called, and what is read in spite of it."""

from __future__ import annotations

import random
import re
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import pytest
from rosbags.highlevel import AnyReader, AnyReaderError

from pipeline.sources import SourceError, open_source
from tests.fuzz.run import mutated
from tests.pipeline.sources.made.bags import Kind, write_bag
from tests.pipeline.sources.rosbag.test_source import KINDS, path_of

DAMAGED = {
    "camera's type": (
        ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Compres:edImage"),
        "camera: messages of unknown types on /front/image_raw/compressed (Compres:edImage)",
    ),
    "camera's package": (
        ("sensor_msgs/msg/CompressedImage", "sens\u00d8r_msgs/msg/CompressedImage"),
        "camera: messages of unknown types on /front/image_raw/compressed (CompressedImage)",
    ),
    "camera's count": (
        (r"count: 3(?=\n    topic_metadata:\n      name: /front/image_raw)", "count: 0"),
        "camera: no messages on /front/image_raw/compressed",
    ),
    "camera's name": (("/front/image_raw/compressed", "/front/image_raw/compresse"), "no image within 0.1 s"),
    "LiDAR's type": (
        ("sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/PointCl"),
        "LiDAR: messages of unknown types on /velodyne_points (PointCl)",
    ),
    "LiDAR's name": (("/velodyne_points", "/velodyne_point"), "LiDAR: no complete sweep in the bag"),
}


_OF_PYTHON = re.compile(r"codec|unpack|buffer|object|NoneType|attribute|out of range|Errno|[a-z]Error|b'|^'|subscript")
"""What Python says where code stumbles over damaged data."""


@pytest.mark.parametrize("kind", KINDS)
def test_whatever_is_damaged_is_said_of_the_file_and_not_of_the_code(kind: Kind, tmp_path: Path) -> None:
    bag = write_bag(path_of(tmp_path, kind), kind, 1, every=50)
    said = set()
    for file in sorted(bag.iterdir()) if bag.is_dir() else [bag]:
        whole, chance = file.read_bytes(), random.Random(file.suffix)
        for _ in range(60):
            file.write_bytes(mutated(whole, whole, chance))
            try:
                notes = open_source(f"rosbag:{bag}").notes
            except SourceError as error:
                said.add(str(error).removeprefix(f"{tmp_path}/"))
            else:
                said |= {f"{bag.name}: {note}" for note in notes if note.startswith("damaged: ")}
        file.write_bytes(whole)
    assert all(each.startswith(bag.name) for each in said)
    reasons = {each.removeprefix(f"{bag.name}: cannot be read as a bag: ") for each in said}
    assert len(reasons) > 3
    assert {each for each in reasons if _OF_PYTHON.search(each)} == set()


def _raising(error: Exception) -> Callable[[object], NoReturn]:
    def fails(_: object) -> NoReturn:
        raise error

    return fails


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"), "a name in it is damaged: not UTF-8"),
        (struct.error("unpack requires a buffer of 4 bytes"), "a record in it is cut off"),
        (IndexError("list index out of range"), "a record in it is cut off"),
        (TypeError("'NoneType' object is not subscriptable"), "a record in it is damaged"),
        (AnyReaderError("A metadata key is missing KeyError('version')."), "A metadata key is missing 'version'"),
        (sqlite3.DatabaseError("file is not a database"), "file is not a database"),
        (OSError(5, "Input/output error"), "Input/output error"),
    ],
)
def test_what_the_library_stumbles_over_is_said_in_words(
    error: Exception, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bag = write_bag(tmp_path / "drive.bag", "ros1", 1)
    monkeypatch.setattr(AnyReader, "open", _raising(error))
    with pytest.raises(SourceError) as refused:
        open_source(f"rosbag:{bag}")
    assert str(refused.value).endswith(f"drive.bag: cannot be read as a bag: {reason}")


@pytest.mark.parametrize("what", DAMAGED)
@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_sensor_lost_to_damaged_metadata_is_said_in_each_frame(kind: Kind, what: str, tmp_path: Path) -> None:
    """The other sensor's frames remain."""
    (pattern, damage), says = DAMAGED[what]
    bag = write_bag(tmp_path / "drive", kind)
    metadata = (bag / "metadata.yaml").read_text(encoding="utf-8")
    damaged, changes = re.subn(pattern, damage, metadata, count=1)
    assert changes == 1
    (bag / "metadata.yaml").write_text(damaged, encoding="utf-8")
    source = open_source(f"rosbag:{bag}")
    assert len(source) == 3
    for index in range(3):
        frame = source.frame(index)
        assert (frame.sweep is None, frame.image is None) == ("LiDAR" in what, "camera" in what)
        assert says in frame.notes
