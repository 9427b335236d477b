"""/api/labels/queue: the recordings to label, by whom, and how far each is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter

from app.labels.service.desk import LabelDesk
from app.web.routes.labels.work_shapes import EffortJson, WorkChange, WorkJson
from app.web.routes.refusals import refusing

if TYPE_CHECKING:
    from app.labels.store.database import Database


def label_work_router(desk: LabelDesk) -> APIRouter:
    """Routes about many recordings."""
    router = APIRouter(prefix="/api/labels", tags=["labels"])

    @router.get("/queue")
    def queue() -> list[WorkJson]:
        """List the recordings in the label database, most valuable first, those that are done last."""
        with refusing():
            return _queue(desk.kept.opened())

    @router.post("/queue", responses={404: {"description": "No such recording"}})
    def change(body: WorkChange) -> list[WorkJson]:
        """Assign a recording, or set its state; answers with the queue. 409 where its labeler would mark it as done."""
        from app.labels.store.work import put  # with the database's library

        with refusing():
            database = desk.kept.opened()
            put(database, body.drive, body.person, person=body.assign, state=body.state)
            return _queue(database)

    return router


def _queue(database: Database) -> list[WorkJson]:
    from app.labels.store.effort import efforts
    from app.labels.store.work import queue

    done = [
        (each.key, EffortJson(person=each.person, acts=each.acts, active_s=round(each.active_s, 1)))
        for each in efforts(database)
    ]
    return [WorkJson(**vars(each), efforts=[one for key, one in done if key == each.key]) for each in queue(database)]
