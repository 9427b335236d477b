"""The files of a recording in several files name each other, so that one that is missing or was replaced is noticed.

A file says at its beginning which one it follows and that one's last hash, and at its end which one follows it. A file
whose end could not be written, because the disk hung, says nothing at its end: its chain is cut off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.recording.mcap.chain import hashes_of_links
from pipeline.recording.mcap.reader import McapFile

FOLLOWS, CONTINUES = "cipv-follows", "cipv-continues"
"""Names of the metadata records at a file's beginning and end."""
NEIGHBOURS = frozenset((FOLLOWS, CONTINUES))
"""A copy of a part of a recording has none of them."""


@dataclass(frozen=True)
class EarlierFile:
    """The file before one of the same recording."""

    name: str
    """Without its folder."""
    sha256: str
    """Hash in the link after its last chunk, which stays when labels are added; empty if that is not known."""

    def to_metadata(self) -> dict[str, str]:
        """In MCAP's format: text to text."""
        return {"file": self.name, "sha256": self.sha256}


def missing_neighbours(path: Path, file: McapFile) -> tuple[str, ...]:
    """What is wrong with the files before and after ``path``, which ``file`` reads, in words; empty for nothing, or if
    it is the only one."""
    return tuple(_problems(path, file))


def _problems(path: Path, file: McapFile) -> Iterator[str]:
    follows, continues = (file.metadata(name) or {} for name in (FOLLOWS, CONTINUES))
    if follows:
        yield from _problem_before(path, follows.get("file", ""), follows.get("sha256", ""))
    if continues:
        yield from _problem_after(path, continues.get("file", ""))


def _problem_before(path: Path, name: str, sha256: str) -> Iterator[str]:
    before = _beside(path, name)
    if before is None:
        yield f"the file before it, {name}, is not beside it"
    elif sha256 and sha256 not in _hashes(before):
        yield f"{name} is not the file that came before it, or was changed"


def _problem_after(path: Path, name: str) -> Iterator[str]:
    after = _beside(path, name)
    if after is None:
        yield f"{name}, in which the recording continues, is not beside it"
        return
    try:
        with McapFile(after) as file:
            said = file.metadata(FOLLOWS) or {}
    except (BadInput, OSError):
        said = {}
    if said.get("file") != path.name or said.get("sha256") not in _hashes(path):
        yield f"{name} is not the file in which the recording continues, or was changed"


def _hashes(path: Path) -> frozenset[str]:
    """Of its links; empty if it cannot be read."""
    try:
        return hashes_of_links(path)
    except (BadInput, OSError):
        return frozenset()


def _beside(path: Path, name: str) -> Path | None:
    """A file of this name in the same folder; None if there is none, or if it is no name of a file there."""
    found = path.with_name(name) if name and name == Path(name).name else None
    try:
        return found if found is not None and found.is_file() else None
    except OSError:  # a name that is too long
        return None
