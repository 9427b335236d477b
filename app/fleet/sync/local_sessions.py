"""The sessions of a folder: which are finished, and when each began."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import open_regular
from pipeline.recording.mcap.index import MAGIC
from pipeline.recording.mcap.reader import McapFile, NotMcap


@dataclass(frozen=True, order=True)
class LocalSession:
    """A session whose recording has ended. Ordered by age, the oldest first."""

    began_ns: int
    """When its first message was received, Unix nanoseconds."""
    name: str
    """Path below the folder, with slashes, without ``.mcap``."""
    file: Path
    """Where it is on this machine."""
    bytes: int
    """Of the file."""


@dataclass(frozen=True)
class LocalSessions:
    """The contents of a folder."""

    finished: tuple[LocalSession, ...]
    """The oldest first."""
    unfinished: tuple[str, ...]
    """Names of files that are still being written or were cut off, sorted."""


class SessionFolder:
    """A folder that sessions are recorded to. What a finished file begins with is read once.

    Args:
        folder: see above.
        except_in: a folder whose files are left out, such as one that they are copied to.
    """

    def __init__(self, folder: Path, except_in: Path | None = None) -> None:
        if not folder.is_dir():
            raise BadInput(f"{folder}: no such folder")
        self._folder = folder.resolve()
        self._except_in = except_in.resolve() if except_in is not None else None
        if self._except_in == self._folder:
            raise BadInput(f"{folder}: cannot be copied into itself; give another folder or a store")
        self._known: dict[tuple[Path, int, int], LocalSession] = {}

    def look(self) -> LocalSessions:
        """The sessions in it now, and in folders below. A file that vanishes meanwhile is left out."""
        finished, unfinished = [], []
        for file in self._folder.rglob("*.mcap"):
            name = file.relative_to(self._folder).with_suffix("").as_posix()
            if any(part.startswith(".") for part in name.split("/")):
                continue
            if self._is_left_out(file):
                continue
            try:
                session = self._session(file, name)
            except FileNotFoundError:
                continue
            except OSError as error:
                raise BadInput(f"{file}: {error.strerror or error}") from None
            if session is None:
                unfinished.append(name)
            else:
                finished.append(session)
        return LocalSessions(tuple(sorted(finished)), tuple(sorted(unfinished)))

    def _is_left_out(self, file: Path) -> bool:
        """What lies around this folder leaves nothing out."""
        inner = self._except_in
        return inner is not None and inner.is_relative_to(self._folder) and file.is_relative_to(inner)

    def _session(self, file: Path, name: str) -> LocalSession | None:
        """None for a file that is not finished."""
        facts = file.stat()
        key = file, facts.st_size, facts.st_mtime_ns
        if key not in self._known:
            if not _is_finished(file):
                return None
            self._known[key] = LocalSession(_began_ns(file), name, file, facts.st_size)
        return self._known[key]


def _is_finished(file: Path) -> bool:
    """Whether a file ends as an MCAP file does: those being written, or cut off, do not."""
    with open_regular(file) as opened:
        size = opened.seek(0, io.SEEK_END)
        if size < 2 * len(MAGIC):
            return False
        opened.seek(-len(MAGIC), io.SEEK_END)
        return opened.read() == MAGIC


def _began_ns(file: Path) -> int:
    """0 for a file that cannot be read, or is empty: it is copied all the same, first."""
    try:
        with McapFile(file) as session:
            return min((chunk.start_ns for chunk in session.directory.chunks), default=0)
    except (NotMcap, RuntimeError, ValueError):
        return 0
