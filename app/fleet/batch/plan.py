"""Plans a batch: which drives to run, and which are already done."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

from app.fleet.batch.addresses import Recording, recordings
from app.fleet.batch.job import Job, aside_file, done_file
from app.fleet.batch.keys import RunKey, code_digest, networks_digest
from app.fleet.runs import make_latest
from app.fleet.store import Store
from pipeline.common.errors import BadInput
from pipeline.detection import DetectorChoice
from pipeline.params import Params, ParamsError
from pipeline.run import Sensors

_PLAN = "batch.json"
_VERSION = 1


@dataclass(frozen=True)
class Plan:
    """A batch as requested."""

    addresses: tuple[str, ...]
    """As typed by the user."""
    params: Params
    """Of the pipeline, the same for every recording."""
    choice: DetectorChoice
    """Of networks."""
    sensors: Sensors = "both"
    """With a single sensor, runs as if the cars had no other."""
    rings: int = 16
    """Number of LiDAR channels to keep if a recording has more."""
    keeps_results: bool = False
    """Also write the results as JSON lines."""

    def save(self, store: Store) -> None:
        """Save the plan for ``--resume``."""
        said = {
            "version": _VERSION,
            "addresses": list(self.addresses),
            "params": self.params.model_dump(mode="json"),
            "choice": asdict(self.choice),
            "sensors": self.sensors,
            "rings": self.rings,
            "results": self.keeps_results,
        }
        store.write(_PLAN, json.dumps(said, indent=1).encode())

    @staticmethod
    def load(store: Store) -> Plan:
        """The plan of the last batch in a folder. Raises BadInput if there was none."""
        data = store.read(_PLAN)
        if data is None:
            raise BadInput(f"{store.address}: no batch to resume here; give the recordings")
        try:
            said: dict[str, Any] = json.loads(data)
            if said["version"] != _VERSION:
                raise BadInput(f"{store.address}/{_PLAN}: version {said['version']!r}; this program reads {_VERSION}")
            return Plan(
                tuple(map(str, said["addresses"])),
                Params.model_validate(said["params"]),
                DetectorChoice(**said["choice"]),
                said["sensors"],
                int(said["rings"]),
                bool(said["results"]),
            )
        except (ValueError, KeyError, TypeError, ParamsError):
            raise BadInput(f"{store.address}/{_PLAN}: damaged; give the recordings again") from None


@dataclass(frozen=True)
class PlannedWork:
    """A plan and its progress."""

    store: Store
    """Storage of its tables."""
    key: RunKey
    """Inputs of the run; identifies the run in the store."""
    jobs: tuple[Job, ...]
    """Drives that have not been run yet."""
    all: tuple[Recording, ...]
    """Every drive of the plan."""

    @property
    def done_before(self) -> int:
        """Number of drives finished by an earlier batch."""
        return len(self.all) - len(self.jobs)


def work_of(plan: Plan, store: Store) -> PlannedWork:
    """The remaining work. Raises BadInput for an address without recordings."""
    key = RunKey(code_digest(), networks_digest(plan.choice), plan.params, plan.sensors, plan.rings)
    found = recordings(plan.addresses)
    done = {*store.names(f"done/run={key.name}"), *store.names(f"aside/run={key.name}")}
    jobs = [
        Job(recording, key, plan.choice, store, plan.keeps_results)
        for recording in found
        if not {done_file(key.name, recording), aside_file(key.name, recording)} & done
    ]
    return PlannedWork(store, key, tuple(jobs), tuple(found))


def begin(plan: Plan, work: PlannedWork, store: Store) -> None:
    """Save the plan before the first drive runs. Raises BadInput if the store is not writable."""
    plan.save(store)
    make_latest(store, work.key.name)
    note_run(plan, work, store)


def note_run(plan: Plan, work: PlannedWork, store: Store) -> None:
    """Save what a run is made from. Raises BadInput if the store is not writable."""
    store.write(f"runs/{work.key.name}.json", json.dumps(work.key.to_json(plan.choice), indent=1).encode())
