"""The open recording and its labels in the database, which is opened on first use."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from app.drive.open_recording import OpenRecording
from app.labels.errors import ActRefused, NoSuchLabel
from pipeline.common.garbage_collection import freeze_loaded_objects

if TYPE_CHECKING:
    from app.labels.store.database import Database
    from app.labels.store.drive_labels import DriveInfo, DriveLabels


class KeptLabels:
    """Any thread. database: storage of labels. open_later: opens it on first use; without either, a temporary database
    is created on first use and discarded at the end. station: identifies this server, also after a restart, as the
    owner of its parameters; set before anything is opened."""

    def __init__(self, database: Database | None, open_later: Callable[[], Database] | None) -> None:
        self.station = socket.gethostname()
        self._database = database
        self._open_later = open_later
        self._opening = threading.Lock()

    @property
    def is_open(self) -> bool:
        return self._database is not None

    @property
    def outlast(self) -> bool:
        """Whether the database is permanent, so that it may contain earlier labels and others may change them."""
        return self.is_open or self._open_later is not None

    def of(self, uri: str, recording: OpenRecording | None) -> DriveLabels:
        """Labels of a recording, or the log of a source without frames to label. BadInput if the database cannot be
        opened.

        Loads the acts as well: an act must not fail because no file can be opened at that moment.
        """
        import app.labels.acts.measured
        import app.labels.acts.registry  # noqa: F401
        from app.labels.store.drive_labels import DriveLabels

        return DriveLabels(self.opened(), _info(uri, recording), self.station)

    def close(self) -> None:
        with self._opening:
            if self._database is not None:
                self._database.close()

    def opened(self) -> Database:
        """The database, opened on first use."""
        with self._opening:
            if self._database is None:
                self._database = (self._open_later or _temporary)()
                freeze_loaded_objects("labels")
            return self._database


@dataclass(eq=False)
class Opened:
    """The open source."""

    uri: str
    """As it was opened."""
    recording: OpenRecording | None
    """None if it has no frames to label."""
    kept: KeptLabels
    """Storage of its labels."""
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _labels: DriveLabels | None = None

    @property
    def labels(self) -> DriveLabels:
        """Loaded from the database on first use."""
        with self._lock:
            if self._labels is None:
                self._labels = self.kept.of(self.uri, self.recording)
            return self._labels

    @property
    def key(self) -> str | None:
        """Key of the recording; None if the source has no frames to label."""
        return self.labels.info.key if self.recording is not None else None

    def framed(self) -> OpenRecording:
        """The recording to label. NoSuchLabel if there is none."""
        if self.recording is None:
            raise NoSuchLabel("no recording is open")
        return self.recording

    def meant(self, drive: str | None) -> DriveLabels:
        """The labels of the source with this key. ActRefused if another recording is open, or a recording is open and
        ``drive`` is None."""
        if drive != self.key:
            raise ActRefused("another recording is open now")
        return self.labels

    def named(self, drive: str) -> tuple[OpenRecording, DriveLabels]:
        """ActRefused if the recording with this key is not open, NoSuchLabel if it has no frames to label."""
        return self.framed(), self.meant(drive)


def _temporary() -> Database:
    from app.labels.store.database import Database

    return Database.temporary()


def _info(uri: str, recording: OpenRecording | None) -> DriveInfo:
    from app.labels.store.drive_labels import info_of, info_of_uri

    return info_of_uri(uri) if recording is None else info_of(recording.setup.source, recording.names)
