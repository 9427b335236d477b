"""The folder of a batch, on disk or in a store: whole files by name, written atomically."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

from pipeline.common.errors import BadInput
from pipeline.common.files.remote_files import NotReachable, NotThere, file_system, is_remote, patiently
from pipeline.common.files.whole_files import replacing

try:
    import fcntl
except ImportError:  # Windows: nothing keeps two batches apart
    fcntl = None  # type: ignore[assignment]

_BLOCK_BYTES = 1 << 20
_LOCK = ".lock"


class Store:
    """Files below one address. Can be pickled and used in any process. Raises BadInput for an address that cannot be
    used, ``Overloaded`` while a store keeps failing.
    """

    def __init__(self, address: str) -> None:
        self.address = address.rstrip("/") if is_remote(address) else str(Path(address).expanduser().absolute())

    def __reduce__(self) -> tuple[type[Store], tuple[str]]:
        return Store, (self.address,)

    @property
    def folder(self) -> Path | None:
        """The folder on this machine; None in a store."""
        return None if is_remote(self.address) else Path(self.address)

    @cached_property
    def _opened(self) -> tuple[Any, str]:
        return file_system(self.address)

    @property
    def system(self) -> Any:
        """fsspec's file system of it."""
        return self._opened[0]

    def path(self, name: str) -> str:
        """Path of a file in ``system``."""
        return f"{self._opened[1].rstrip('/')}/{name}"

    def read(self, name: str) -> bytes | None:
        """A whole file; None where there is none."""
        try:
            return patiently(lambda: bytes(self.system.cat_file(self.path(name))), f"{self.address}/{name}")
        except NotThere:
            return None
        except NotReachable:  # some stores deny access to what is not there
            if self.has(name):
                raise
            return None

    def has(self, name: str) -> bool:
        """Whether there is such a file."""
        self.system.invalidate_cache()
        return bool(patiently(lambda: self.system.isfile(self.path(name)), f"{self.address}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        """Write a whole file, replacing any existing one atomically. Raises BadInput if the address is not writable."""
        if self.folder is None:
            patiently(lambda: self.system.pipe_file(self.path(name), data), f"{self.address}/{name}")
            return
        target = self.folder / name
        try:
            with replacing(target) as file:
                file.write(data)
        except OSError as error:
            raise _not_writable(target, error) from None

    def put(self, name: str, file: Path) -> None:
        """The same for a file on this machine, without reading it into memory."""
        if self.folder is None:
            patiently(lambda: self.system.put_file(str(file), self.path(name)), f"{self.address}/{name}")
            return
        target = self.folder / name
        try:
            with file.open("rb") as source, replacing(target) as written:
                shutil.copyfileobj(source, written, _BLOCK_BYTES)
        except OSError as error:
            raise _not_writable(target, error) from None

    def put_all(self, files: Mapping[str, Path]) -> None:
        """The same for several files, by name, all at once, since each waits for the answer of a store."""
        with ThreadPoolExecutor(max(1, len(files))) as beside:
            for put in [beside.submit(self.put, name, file) for name, file in files.items()]:
                put.result()

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Keeps other batches out of a folder on this machine for the block: two that pack the same tables would leave
        drives out. Stores have no locks. Raises BadInput while another one is at work, or if it is not writable."""
        if self.folder is None or fcntl is None:
            yield
            return
        target = self.folder / _LOCK
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = target.open("a")
        except OSError as error:
            raise _not_writable(target, error) from None
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BadInput(
                    f"{self.address}: another batch is writing there; wait for it, or give another --out"
                ) from None
            except OSError:  # a network disk without locks
                pass
            yield

    def names(self, folder: str) -> list[str]:
        """Every file below a folder, as names of this store, sorted; none where there is no such folder."""
        if self.folder is not None:
            top = self.folder / folder
            found = [
                str(Path(parent, name).relative_to(self.folder)) for parent, _, names in os.walk(top) for name in names
            ]
            return sorted(name for name in found if not name.rpartition("/")[2].startswith("."))
        return sorted(self._listed(folder))

    def sizes(self, folder: str) -> dict[str, int]:
        """The same files, with their sizes in bytes."""
        if self.folder is not None:
            return {name: (self.folder / name).stat().st_size for name in self.names(folder)}
        return {name: int(facts["size"]) for name, facts in self._listed(folder).items()}

    def _listed(self, folder: str) -> dict[str, dict[str, Any]]:
        """Of a store: what it says of each file below a folder, by name."""
        self.system.invalidate_cache()
        start = self.path("")
        try:
            listed: dict[str, dict[str, Any]] = patiently(
                lambda: self.system.find(self.path(folder), detail=True), f"{self.address}/{folder}"
            )
        except NotReachable:
            return {}
        return {name.removeprefix(start): facts for name, facts in listed.items()}


def _not_writable(target: Path, error: OSError) -> BadInput:
    return BadInput(f"{target} cannot be written: {error.strerror or error}")
