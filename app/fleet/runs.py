"""Which runs a batch's folder holds, and what they are made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter
from typing_extensions import TypedDict

from app.fleet.store import Store
from app.fleet.stored_json import read_json
from pipeline.common.errors import BadInput
from pipeline.params import Params

LATEST = "latest.json"
_PARTS = ("code", "networks", "sensors", "rings")
_RINGS = 16
"""Usual number of LiDAR channels that are kept."""


class _Latest(TypedDict):
    run: str


class _Run(TypedDict, total=False):
    code: Any
    networks: Any
    sensors: Any
    rings: Any
    params: dict[str, dict[str, Any]]


class _Aside(TypedDict):
    address: str
    reason: str


_LATEST, _RUN, _ASIDE = TypeAdapter(_Latest), TypeAdapter(_Run), TypeAdapter(_Aside)


def runs_of(store: Store) -> list[str]:
    """Names of all runs, sorted."""
    return [name.removeprefix("runs/").removesuffix(".json") for name in store.names("runs")]


def check_run(store: Store, run: str) -> None:
    """Raises BadInput if there is no such run. Called before a name from outside becomes part of a file's."""
    known = runs_of(store)
    if run not in known:
        raise BadInput(f"{store.address}: no run {run!r}; there are {', '.join(known) or 'none'}")


def make_latest(store: Store, run: str) -> None:
    """Make a run the one that is searched and compared unless another is named."""
    store.write(LATEST, json.dumps({"run": run}).encode())


def latest_run(store: Store) -> str:
    """The run of the last batch. Raises BadInput if there was none."""
    said = read_json(store, LATEST, _LATEST)
    if said is None:
        raise BadInput(f"{store.address}: no tables of `cipv batch` here")
    return said["run"]


def about_run(store: Store, run: str) -> dict[str, Any]:
    """What a run is made from, by name: code, networks, sensors, rings, and every parameter, such as
    ``cluster.tolerance_m``. Raises BadInput if there is no such run."""
    check_run(store, run)
    said = read_json(store, f"runs/{run}.json", _RUN) or {}
    return {name: said.get(name) for name in _PARTS} | _flat(said.get("params", {}))


def summary(about: Mapping[str, Any]) -> str:
    """What distinguishes a run from one with default settings, in a line: ``cluster.tolerance_m=0.7, lidar only``."""
    usual = _flat(Params().model_dump(mode="json"))
    said = [f"{name}={about[name]}" for name in usual if name in about and about[name] != usual[name]]
    if about.get("sensors") not in (None, "both"):
        said.append(f"{about['sensors']} only")
    if about.get("rings") not in (None, _RINGS):
        said.append(f"{about['rings']} rings")
    return ", ".join(said) or "default parameters"


def differences(base: Mapping[str, Any], run: Mapping[str, Any]) -> list[str]:
    """What differs between two runs, one entry each: ``cluster.tolerance_m 0.6 → 0.7``, ``other code``."""
    said = [f"other {name}" for name in ("code", "networks") if base.get(name) != run.get(name)]
    names = [name for name in dict.fromkeys((*base, *run)) if name not in ("code", "networks")]
    changed = [name for name in names if base.get(name) != run.get(name)]
    return said + [f"{name} {_value(base.get(name))} → {_value(run.get(name))}" for name in changed]


def _flat(params: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{section}.{name}": value for section, values in params.items() for name, value in values.items()}


def _value(value: object) -> str:
    return "–" if value is None else str(value)


def set_aside(store: Store, run: str) -> dict[str, str]:
    """Address → reason of every recording that a run set aside and has not processed since."""
    found = {}
    done = {_drive(name) for name in store.names(f"done/run={run}")}
    for name in store.names(f"aside/run={run}"):
        if _drive(name) in done:
            continue
        said = read_json(store, name, _ASIDE)
        if said is not None:  # else it has just been processed
            found[said["address"]] = said["reason"]
    return found


def _drive(name: str) -> str:
    """The drive that a file below ``done`` or ``aside`` is about."""
    return name.rpartition("/")[2].split(".")[0]
