"""Copies the sessions of a car, and reads what has arrived."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.cli import main
from app.fleet.store import Store
from app.fleet.sync.sync import Sync, SyncOptions, SyncTally
from pipeline.common.progress import silent
from tests.app.fleet.s3 import BUCKET

S3 = f"s3://{BUCKET}/car-7"
Begun = list[tuple[str, int]]


def synced(car: Path, address: str, **options: Any) -> tuple[Sync, Begun]:
    """A run, and the files it sent, in order."""
    begun: Begun = []

    def begin(what: str, size: int) -> Any:
        begun.append((what, size))
        return silent

    sync = Sync(car, Store(address), SyncOptions(**options), begin, SyncTally())
    sync.run()
    return sync, begun


def there(address: str) -> dict[str, bytes]:
    store = Store(address)
    return {name: store.read(name) or b"" for name in store.names("")}


def cipv(*arguments: object) -> int:
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    return int(end.value.code or 0)
