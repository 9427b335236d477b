"""Resolves addresses to recordings: folders, globs, stores, list files, and any source by its scheme."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import NotReachable, file_system, is_remote, patiently, version_of
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular
from pipeline.source_kinds import is_live, kind_named, looks_like
from pipeline.sources.fingerprint import fingerprint

_LIST_ENDINGS = (".txt", ".list")
_SESSION = ".mcap"
_GLOB = re.compile(r"[*?\[]")
_LONGEST_SLUG = 40


@dataclass(frozen=True, order=True)
class Recording:
    """One recording of a fleet."""

    address: str
    """Address for ``open_source``."""
    mark: str
    """Sixteen characters that change if its files are edited or replaced."""

    @property
    def drive(self) -> str:
        """Its name in tables and links: the file's own name, and eight characters derived from the whole address."""
        _, _, rest = self.address.rpartition(":")
        stem = PurePosixPath(rest.partition("?")[0].rstrip("/")).name.removesuffix(_SESSION)
        slug = re.sub(r"[^A-Za-z0-9]+", "-", stem).strip("-")[-_LONGEST_SLUG:]
        return f"{slug or 'drive'}-{hashlib.sha256(os.fsencode(self.address)).hexdigest()[:8]}"


def recordings(addresses: Iterable[str]) -> list[Recording]:
    """Every recording at the addresses, without duplicates, sorted. Raises BadInput for an address without
    recordings."""
    found: dict[str, Recording] = {}
    for address in addresses:
        here = {each.address: each for each in _of(address.strip())}
        if not here:
            raise BadInput(f"{address}: no recordings found; stores and folders are searched for *{_SESSION}")
        found |= here
    return sorted(found.values())


def absolute(address: str) -> str:
    """An address that means the same in any working folder: of a worker, or of a batch that is resumed elsewhere."""
    if not address or is_remote(address):
        return address
    if not _has_scheme(address):
        return str(Path(address.removeprefix("file://")).expanduser().absolute())
    scheme, _, rest = address.partition(":")
    path, mark, options = rest.partition("?")
    place = Path(path).expanduser()
    if not path or not place.exists():
        return address  # such as a scenario's name
    return f"{scheme}:{place.absolute()}{mark}{options}"


def _of(address: str) -> Iterator[Recording]:
    if not address:
        return
    address = absolute(address)
    if is_remote(address):
        yield from _in_store(address)
    elif _has_scheme(address):
        if is_live(address):
            raise BadInput(f"{address}: these are live sensors; recordings are needed here")
        yield Recording(address, fingerprint(address))
    else:
        yield from _on_disk(address)


def _has_scheme(address: str) -> bool:
    scheme, colon, _ = address.partition(":")
    return bool(colon) and kind_named(scheme) is not None


def _on_disk(address: str) -> Iterator[Recording]:
    if _GLOB.search(address) and not Path(address).exists():
        place = Path(address)
        fixed = next(n for n, part in enumerate(place.parts) if _GLOB.search(part))
        for match in sorted(Path(*place.parts[:fixed]).glob(str(Path(*place.parts[fixed:])))):
            yield from _below(match)
        return
    place = Path(address)
    if not place.exists():
        raise BadInput(f"{address}: no such file or folder")
    if place.suffix in _LIST_ENDINGS:
        yield from _listed(read_regular(place, LARGEST_TEXT_BYTES), address)
    else:
        yield from _below(place)


def _below(place: Path) -> Iterator[Recording]:
    """The recording at a path; for a folder that is not a recording, all recordings inside."""
    if _is_recording(place):
        yield Recording(str(place), fingerprint(str(place)))
    elif place.is_dir():
        for parent, folders, files in os.walk(place):
            inside = [name for name in folders if _is_recording(Path(parent, name))]
            folders[:] = sorted(name for name in folders if name not in inside and not name.startswith("."))
            sessions = [name for name in files if name.endswith(_SESSION) and not name.startswith(".")]
            for name in sorted(inside + sessions):
                path = str(Path(parent, name))
                yield Recording(path, fingerprint(path))


def _is_recording(place: Path) -> bool:
    return (place.suffix == _SESSION and place.is_file()) or looks_like(place) is not None


def _in_store(address: str) -> Iterator[Recording]:
    system, path = file_system(address)
    if address.endswith(_LIST_ENDINGS):
        yield from _listed(patiently(lambda: bytes(system.cat_file(path)), address), address)
        return
    if _GLOB.search(path):
        listed = patiently(lambda: system.glob(path, detail=True), address)
    elif address.endswith(_SESSION):
        listed = {path: patiently(lambda: system.info(path), address)}
    else:
        listed = patiently(lambda: system.find(path, detail=True), address)
    for name, facts in sorted(listed.items()):
        if name.endswith(_SESSION):
            full = system.unstrip_protocol(name)
            yield Recording(full, _mark(full, facts))


def _mark(address: str, facts: dict[str, Any]) -> str:
    """``fingerprint`` of an address, from the result of a listing."""
    digest = hashlib.sha256(address.encode(errors="replace"))
    digest.update(version_of(facts).encode())
    return digest.hexdigest()[:16]


def _listed(content: bytes, name: str) -> Iterator[Recording]:
    """The recordings in a list file, one address per line; empty lines and those that begin with # are ignored."""
    try:
        lines: Sequence[str] = content.decode("utf-8").splitlines()
    except UnicodeDecodeError:
        raise BadInput(f"{name}: not a text file; expected one address per line") from None
    for number, line in enumerate(lines, 1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                yield from _of(line.strip())
            except (BadInput, NotReachable) as error:
                raise BadInput(f"{name}, line {number}: {error}") from None
