"""Which runs a batch's folder holds."""

from __future__ import annotations

import json
from typing import Any

from app.fleet.store import Store
from pipeline.common.errors import BadInput

LATEST = "latest.json"


def runs_of(store: Store) -> list[str]:
    """Names of all runs, sorted."""
    return [name.removeprefix("runs/").removesuffix(".json") for name in store.names("runs")]


def latest_run(store: Store) -> str:
    """The run of the last batch. Raises BadInput if there was none."""
    data = store.read(LATEST)
    if data is None:
        raise BadInput(f"{store.address}: no tables of `cipv batch` here")
    return str(json.loads(data)["run"])


def about_run(store: Store, run: str) -> dict[str, Any]:
    """What a run is made from: code, networks, parameters."""
    data = store.read(f"runs/{run}.json")
    if data is None:
        raise BadInput(f"{store.address}: no run {run!r}; there are {', '.join(runs_of(store)) or 'none'}")
    found: dict[str, Any] = json.loads(data)
    return found


def set_aside(store: Store, run: str) -> dict[str, str]:
    """Address → reason of every recording that a run set aside and has not processed since."""
    found = {}
    done = {_drive(name) for name in store.names(f"done/run={run}")}
    for name in store.names(f"aside/run={run}"):
        if _drive(name) in done:
            continue
        said = json.loads(store.read(name) or b"{}")
        found[str(said["address"])] = str(said["reason"])
    return found


def _drive(name: str) -> str:
    """The drive that a file below ``done`` or ``aside`` is about."""
    return name.rpartition("/")[2].split(".")[0]
