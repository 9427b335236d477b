"""Which packs of tables a run has, and which drives are in each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import TypeAdapter

from app.fleet.store import Store
from app.fleet.stored_json import read_json

_PACKS = TypeAdapter(list[dict[str, str]])


@dataclass(frozen=True)
class Pack:
    """A few hundred drives."""

    number: int
    """From 0, in the order of packing; names its files."""
    marks: Mapping[str, str]
    """Drive → mark of the recording that its rows are of."""


def packed_file(table: str, run: str, number: int) -> str:
    """The name in the store of one pack of a table."""
    return f"packed/{table}/run={run}/{number:05d}.parquet"


def packs_of(store: Store, run: str) -> list[Pack]:
    """Every pack of a run, by number."""
    rows = read_json(store, _index(run), _PACKS) or []
    return [Pack(number, marks) for number, marks in enumerate(rows)]


def keep_index(store: Store, run: str, fresh: Pack) -> None:
    """Note a pack that was written."""
    rows = {each.number: dict(each.marks) for each in packs_of(store, run)} | {fresh.number: dict(fresh.marks)}
    store.write(_index(run), json.dumps([rows[number] for number in sorted(rows)]).encode())


def _index(run: str) -> str:
    return f"packed/run={run}.json"
