"""/api/labels/queue, projects and control: the recordings to label, by whom, how far each is, and how well."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter, Request

from app.core.client_role import account_of
from app.labels.permissions import check_work
from app.labels.projects.results import ControlResult, ProjectProgress
from app.labels.service.desk import LabelDesk
from app.web.refusals import refusing
from app.web.routes.labels.work_shapes import EffortJson, WorkChange, WorkJson

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
    def change(body: WorkChange, request: Request) -> list[WorkJson]:
        """Assign a recording, or set its state; answers with the queue. 403 where the account's role does not include
        it; 409 where its labeler would mark it as done, or labels are left to review."""
        from app.labels.store.work import put  # with the database's library

        with refusing():
            database = desk.kept.opened()

            def allowed(assigned: str) -> None:
                check_work(account_of(request), assigned, body.assign, body.state, anyway=body.anyway)

            put(
                database,
                body.drive,
                body.person,
                person=body.assign,
                state=body.state,
                anyway=body.anyway,
                allowed=allowed,
            )
            return _queue(database)

    @router.get("/projects")
    def projects() -> list[ProjectProgress]:
        """List the projects with their progress, and each person's changes and active time."""
        from app.labels.projects.progress import progress

        with refusing():
            return progress(desk.kept.opened())

    @router.get("/control")
    def control() -> list[ControlResult]:
        """Compare each person's labels in the control frames with their truth. Accounts need the role reviewer."""
        from app.labels.projects.control import control_results

        with refusing():
            return control_results(desk.kept.opened(), desk.default_classes)

    return router


def _queue(database: Database) -> list[WorkJson]:
    from app.labels.store.effort import efforts
    from app.labels.store.work import queue

    done = [
        (each.key, EffortJson(person=each.person, acts=each.acts, active_s=round(each.active_s, 1)))
        for each in efforts(database)
    ]
    return [WorkJson(**vars(each), efforts=[one for key, one in done if key == each.key]) for each in queue(database)]
