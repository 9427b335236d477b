"""/api/labels/act: change labels, undo and redo. A change is on disk once it is answered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from app.core.client_role import account_of
from app.labels.acts.requests import Import, Propose
from app.labels.errors import Stale
from app.labels.permissions import check_act
from app.labels.service.answers import changes_json
from app.labels.service.desk import ActDone, LabelDesk
from app.web.refusals import refusing
from app.web.routes.labels.act_shapes import ActBody, ActedJson, StaleJson, TaskBegun, Who

if TYPE_CHECKING:
    from app.labels.store.undo_order import Way

_ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {"model": ActedJson},
    202: {"model": TaskBegun, "description": "Still running; state.labels.task has its progress"},
    409: {"model": StaleJson, "description": "Changed by someone else since, or not possible"},
}


def label_acts_router(desk: LabelDesk) -> APIRouter:
    """Routes that change labels."""
    router = APIRouter(prefix="/api/labels", tags=["labels"])

    @router.post("/act", responses=_ANSWERS)
    def act(body: ActBody, request: Request) -> Response:
        """Change labels. One act is one transaction and one undo step; the answer comes once it is on disk."""
        try:
            with refusing():
                check_act(account_of(request), body.act.kind)
                if isinstance(body.act, Propose | Import):
                    number = desk.begin(body.person, body.act, body.drive, body.sent_as)
                    return JSONResponse({"status": "begun", "what": body.act.kind, "task": number}, 202)
                return _answer(desk.act(body.person, body.act, body.drive, body.sent_as))
        except Stale as stale:
            yours = body.act.model_dump(mode="json", by_alias=True)
            item = {"kind": stale.kind, "id": stale.number}
            answer = {"detail": str(stale), "item": item, "theirs": stale.theirs, "yours": yours}
            return JSONResponse(answer | {"revision": stale.revision}, 409)

    @router.post("/undo", responses={200: {"model": ActedJson}})
    def undo(body: Who) -> Response:
        """Undo the person's newest change to labels, parameters or calibration. 409 when there is none, or when someone
        else has changed the same item since."""
        return _move("undo", body)

    @router.post("/redo", responses={200: {"model": ActedJson}})
    def redo(body: Who) -> Response:
        """Redo what the person undid last."""
        return _move("redo", body)

    def _move(way: Way, body: Who) -> Response:
        with refusing():
            return _answer(desk.move(way, body.person, body.drive, body.sent_as))

    return router


def _answer(done: ActDone) -> Response:
    """changed: null if the open source has no frames to label."""
    acted, labels = done.acted, done.labels
    changed = None
    if labels.info.t_ns:
        since = acted.revision if acted.act is None else acted.revision - 1
        changed = changes_json(labels.info, labels.changes(since))
    return JSONResponse(
        {"revision": acted.revision, "act": acted.act, "what": acted.what, "changed": changed, "note": acted.note}
    )
