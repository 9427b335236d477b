"""A server whose recording can be labelled, and what a test asks of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from app.engine.engine import Engine
from app.engine.snapshot import Snapshot
from app.labels.service.desk import LabelDesk
from app.labels.store.database import Database
from app.web.routes.labels.shapes import LabelsOfPerson
from app.web.server import create_app
from pipeline.params import Params
from pipeline.types.source import TruthObject
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.web.serving import WAIT_S, serving

COUNT = 30


class Labelled(Recording):
    """The car is labelled too, 0.2 m nearer than it is, in the first twenty frames."""

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        from pipeline.common.geometry import Cuboid

        if index >= 20:
            return None
        return (TruthObject("Car", Cuboid((30.0 - 0.4 * index + 1.8, 0.0, 0.1), (4.0, 1.6, 1.4), 0.0), 3),)


@contextmanager
def team(database: Database | None = None) -> Iterator[tuple[Engine, httpx.Client]]:
    """A server on a recording whose drive is completely computed."""
    recording = Labelled()
    desk = LabelDesk(database)
    engine = Engine(
        opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri, whole_drives=True, labels=desk
    )
    engine.start()
    try:
        engine.wait_for(lambda s: s.drive.run is not None and s.drive.phase == "done" and s.labels.labelled, WAIT_S)
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            yield engine, client
    finally:
        engine.stop()


def drive(client: httpx.Client) -> str | None:
    """Id of the open recording; None if it cannot be labelled."""
    answer = client.get("/api/labels")
    return answer.json()["drive"]["id"] if answer.is_success else None


def act(client: httpx.Client, person: str = "Ada", **body: Any) -> httpx.Response:
    return client.post("/api/labels/act", json={"person": person, "act": body, "drive": drive(client) or "none"})


def move(client: httpx.Client, way: str, person: str = "Ada") -> httpx.Response:
    """Undo or redo."""
    return client.post(f"/api/labels/{way}", json={"person": person, "drive": drive(client)})


def task(engine: Engine, begun: httpx.Response) -> str:
    """Wait for a task that was started; returns its final message."""
    assert begun.status_code == 202, begun.text

    def ended(shown: Snapshot) -> bool:
        now = shown.labels.task
        return now is not None and now.id == begun.json()["task"] and not now.running

    state = engine.wait_for(ended, WAIT_S).labels.task
    assert state is not None
    return state.error or state.note


def proposed(engine: Engine, client: httpx.Client) -> dict[str, Any]:
    """The only track that the pipeline proposes."""
    task(engine, act(client, kind="propose", **{"from": "run"}))
    (track,) = labels(client)["tracks"]
    return track


def labels(client: httpx.Client, since: int = 0, person: str = "") -> dict[str, Any]:
    answer = client.get("/api/labels", params={"since": since, "person": person}).json()
    LabelsOfPerson.model_validate(answer)
    return answer


def ref(track: dict[str, Any]) -> dict[str, Any]:
    return {"kind": "track", "id": track["id"], "revision": track["revision"]}


CUBOID = {"center": [25.0, 1.0, 0.5], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.1}
