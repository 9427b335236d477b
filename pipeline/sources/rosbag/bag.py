"""One bag: its topics, and their messages by recording time. Older ROS 2 bags contain no message definitions; ROS's own
definitions, and those of Velodyne packets, are then used."""

from __future__ import annotations

import io
import re
import sqlite3
import struct
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from weakref import finalize

from rosbags import rosbag1, rosbag2
from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError

from pipeline.common.files.user_file_errors import given_path, reason_of
from pipeline.common.files.user_files import check_regular, open_regular
from pipeline.formats.velodyne.ros import typestore
from pipeline.recording.mcap.index import MAGIC, SHORTEST_BYTES, Unreadable, is_closed, read_directory, summary_start
from pipeline.sources.rosbag import unpack_budget
from pipeline.sources.rosbag.unpack_budget import CutOff, TooLarge
from pipeline.types.source import SourceError

_SUFFIXES = (".bag", ".db3", ".mcap")
_TEXTS = (".yaml", ".yml")
_LARGEST_TEXT_BYTES = 4 << 20
"""Of the description, which the library reads as a whole: that of ten thousand files has 3 MB."""

_SAID = (AnyReaderError, rosbag1.ReaderError, rosbag2.ReaderError, SerdeError, TypesysError)
"""Errors of the library whose texts are written for people."""
_QUOTED_ERROR = re.compile(r"\b\w+(?:Error|Exception)\(('[^']*')?\)")
_STUMBLED = (
    (UnicodeDecodeError, "a name in it is damaged: not UTF-8"),
    ((struct.error, EOFError, IndexError), "a record in it is cut off"),
    (MemoryError, "it asks for more memory than there is"),
)


class Topic(NamedTuple):
    """One topic of a bag."""

    name: str
    """Including its slashes."""
    kind: str
    """The message type without its package path, as ``PointCloud2``."""
    held: int
    """Number of messages."""
    is_defined: bool
    """Whether the message definition is known, from the bag or, if it contains no definitions, from ROS."""


class _Invalid(ValueError):
    """The text is the reason."""


class BagError(Exception):
    """A bag or a message that cannot be read; the text is the reason."""


class Bag:
    """Open for reading while it is in use. SourceError if it is not a bag."""

    def __init__(self, path: Path) -> None:
        self.path = path
        unpack_budget.install()
        try:
            _check_records(path)
            self._reader = AnyReader([unpack_budget.BoundedPath(path)], default_typestore=typestore())
            self._reader.open()
            finalize(self, self._reader.close)
            self.topics = _topics(self._reader)
        except Exception as error:  # for damaged files, the library raises arbitrary errors
            raise SourceError(f"{path.name}: cannot be read as a bag: {_in_words(error)}") from None

    def messages(
        self, topics: list[str], at_ns: int | None = None, onward: bool = False
    ) -> Generator[tuple[str, int, Any], None, None]:
        """(topic, recording time, message) of all messages, or of those recorded at exactly this time (onward: or
        later), in order.

        BagError if the bag is damaged there.
        """
        connections = [each for each in self._reader.connections if each.topic in topics]
        if not connections:
            return
        until_ns = None if at_ns is None or onward else at_ns + 1
        try:
            for connection, t_ns, raw in self._reader.messages(connections, start=at_ns, stop=until_ns):
                yield connection.topic, t_ns, self._reader.deserialize(raw, connection.msgtype)
        except GeneratorExit:
            raise
        except Exception as error:
            raise BagError(_in_words(error)) from None


def bag_path(path: str) -> Path:
    """The file or folder given by the user. SourceError if it does not exist or is not a bag."""
    if not path:
        raise SourceError("no bag given after the colon")
    try:
        bag = given_path(path, SourceError)
        if not bag.exists():
            raise SourceError(f"{path}: no such file or folder")
        if bag.is_dir() and not (bag / "metadata.yaml").is_file():
            raise SourceError(f"{path}: not a ROS 2 bag: it has no metadata.yaml")
        for each in bag.iterdir() if bag.is_dir() else [bag]:
            if each.suffix in (*_SUFFIXES, *_TEXTS) or each == bag:
                check_regular(each)
            if each.suffix in _TEXTS and each.stat().st_size > _LARGEST_TEXT_BYTES:
                raise _Invalid(f"{each.name} is larger than {_LARGEST_TEXT_BYTES >> 20} MiB")
    except (OSError, RuntimeError, ValueError) as error:
        raise SourceError(f"{path}: cannot be opened: {reason_of(error)}") from None
    if bag.is_file() and bag.suffix not in _SUFFIXES:
        raise SourceError(f"{path}: not a bag; file names end in {', '.join(_SUFFIXES)}")
    return bag


def _check_records(path: Path) -> None:
    """Whether MCAP files without an index consist of records. The library reads these record by record, also through
    the hole of a sparse file, where gigabytes of zeros take no disk: nine of them are a record without content."""
    for each in path.glob("*.mcap") if path.is_dir() else [path] if path.suffix == ".mcap" else []:
        with open_regular(each) as file, suppress(Unreadable, struct.error):  # the library says why it is none
            size = file.seek(0, io.SEEK_END)
            if size < SHORTEST_BYTES or not is_closed(file, size) or summary_start(file, size):
                continue
            directory = read_directory(file, size, walk=True)
            if directory.is_cut and directory.sound_bytes < size - len(MAGIC):
                raise _Invalid(f"{each.name} has no index, and is damaged after {directory.sound_bytes:,} bytes")


def _topics(reader: AnyReader) -> dict[str, Topic]:
    found: dict[str, Topic] = {}
    for connection in reader.connections:
        count = found[connection.topic].held if connection.topic in found else 0
        kind = connection.msgtype.rpartition("/")[2]
        if not isinstance(connection.topic, str):
            raise _Invalid("a topic with an invalid name")
        is_defined = connection.msgtype in reader.typestore.fielddefs
        found[connection.topic] = Topic(connection.topic, kind, count + connection.msgcount, is_defined)
    return found


def _in_words(error: Exception) -> str:
    """The reason in words: of the library what it meant to say, and not what Python said where it stumbled over damaged
    data."""
    if isinstance(error, OSError | sqlite3.Error | TooLarge | CutOff | _Invalid):
        return reason_of(error)
    if isinstance(error, _SAID):
        text = (str(error).strip().splitlines() or [""])[0]
        # an internal error is appended after a colon
        text = text.partition(": ")[0] if error.__context__ is not None else text
        return _QUOTED_ERROR.sub(r"\1", text)[:200].rstrip(".")
    return next((text for kind, text in _STUMBLED if isinstance(error, kind)), "a record in it is damaged")
