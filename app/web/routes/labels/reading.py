"""/api/labels: read the labels of the open recording."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import JSONResponse

from app.labels.acts.request_fields import MOST_FRAMES, Id, Index, PersonOrNobody
from app.labels.service.answers import changes_json, history_json, track_json, window_json
from app.labels.service.desk import LabelDesk
from app.labels.service.next_work import Asked, What, where_next
from app.labels.store.values import HistoryEntry, ItemKind
from app.web.guards.quotas import while_waited_for
from app.web.refusals import refusing
from app.web.routes.drive import current
from app.web.routes.labels.class_shapes import AttributeKindJson, ClassJson, ClassListJson
from app.web.routes.labels.score_shapes import BadFrameJson, ScoreJson, errors_json
from app.web.routes.labels.shapes import ChecksJson, ItemKey, LabelsOfPerson, NextJson, ProblemJson
from app.web.routes.labels.sighting_shapes import WholeTrack, Window
from app.web.routes.shapes.common import MetricJson
from pipeline.common.progress import Progress

LONGEST_WINDOW = 200
_LISTS_AT_ONCE = 2
"""Maximum lists of changes made at a time. One of 10,000 labels takes about 20 MB; on a busy server, clients that ask
again after their timeout would otherwise have many of them made at once. Further requests wait, and are dropped when
the client disconnects."""


def labels_router(desk: LabelDesk) -> APIRouter:
    """Routes that read labels."""
    router = APIRouter(prefix="/api/labels", tags=["labels"])
    threads = ThreadPoolExecutor(_LISTS_AT_ONCE, "cipv-label-lists")

    @router.get("/classes")
    def classes() -> ClassListJson:
        """List the classes and attributes of the project."""
        with refusing():
            known = desk.classes
        return ClassListJson(
            classes=[
                ClassJson(name=each.name, of=each.of, size=each.size, exports=dict(each.exports))
                for each in known.classes.values()
            ],
            attributes=[AttributeKindJson(name=name, values=list(values)) for name, values in known.attributes.items()],
        )

    @router.get("", responses={200: {"model": LabelsOfPerson}})
    async def changes(
        request: Request, since: Annotated[Id, Query()] = 0, person: Annotated[PersonOrNobody, Query()] = ""
    ) -> Response:
        """Get the labels that changed after act ``since``; 0 for all. Ask again whenever ``state.labels.revision`` has
        changed. can_undo, can_redo: for this person."""

        def listed(progress: Progress) -> Response:
            progress(0, 1)
            with refusing():
                labels = desk.labels
                body = changes_json(labels.info, labels.changes(since))
                can_undo, can_redo = desk.possible(person)
            return JSONResponse(body | {"can_undo": can_undo, "can_redo": can_redo})

        return await while_waited_for(request, threads, listed)

    @router.get("/frames", responses={200: {"model": Window}})
    def frames(first: Annotated[Index, Query()], last: Annotated[Index, Query()]) -> Response:
        """Get the labels of up to 200 frames, frame by frame."""
        if not first <= last < first + LONGEST_WINDOW:
            raise HTTPException(422, f"first to last: must span 1 to {LONGEST_WINDOW} frames")
        with refusing():
            return JSONResponse(window_json(desk.labels, first, last))

    @router.get("/tracks/{number}", responses={200: {"model": WholeTrack}})
    def track(number: Id) -> Response:
        """Get a track with all its sightings."""
        with refusing():
            labels = desk.labels
            found = labels.track(number)
            return JSONResponse(track_json(found, labels.authors([found])))

    @router.get("/next")
    def following(
        what: What,
        frame: Annotated[int, Query(ge=-1, le=MOST_FRAMES)],
        direction: Annotated[int, Query(ge=-1, le=1)] = 1,
        person: Annotated[PersonOrNobody, Query()] = "",
        after_kind: Annotated[ItemKind | None, Query()] = None,
        after_id: Annotated[Id, Query()] = 0,
    ) -> NextJson:
        """Find the nearest frame after ``frame``, or before it for a negative direction, where there is something to
        do. after_kind, after_id: a label of that frame that was looked at; the others of the frame come first then.
        person: who asks: what one has made oneself, another reviews."""
        after = (after_kind, after_id) if after_kind is not None else None
        with refusing():
            run = desk.recording.runs.current
            asked = Asked(what, frame, direction, person, after)
            found, why, left = where_next(desk.labels, desk.scores, run, asked)
        item = ItemKey(kind=found.item[0], id=found.item[1]) if found is not None and found.item is not None else None
        return NextJson(frame=found.frame if found is not None else None, why=why, item=item, left=left)

    @router.get("/score")
    def score() -> ScoreJson:
        """Score the present run and the base against accepted labels. The same figures as `cipv evaluate`."""
        with refusing():
            registry, labels = desk.recording.runs, desk.labels
            run = current(desk.recording)
            found = desk.scores.standing(labels, registry.base or run, run)
            return ScoreJson(
                revision=labels.revision,
                run=run.number,
                judged=found.judged,
                metrics=[MetricJson(**vars(metric)) for metric in found.metrics],
                notes=list(found.notes),
                errors=[errors_json(row) for row in found.errors],
                worst=[
                    BadFrameJson(frame=each.index, verdict=each.verdict, truth_m=each.truth_m, error_m=each.error_m)
                    for each in found.worst
                ],
            )

    @router.get("/checks")
    def checks() -> ChecksJson:
        """List what is implausible: jumps, overlaps, empty cuboids, boxes off their cuboids, leads without a track."""
        with refusing():
            found = desk.checks.of(desk.labels, desk.recording)
        return ChecksJson(revision=found.revision, problems=[ProblemJson(**vars(each)) for each in found.problems])

    @router.get("/history", responses={200: {"model": list[HistoryEntry]}})
    def history(kind: ItemKind, number: Annotated[Id, Query(alias="id")]) -> Response:
        """Get the history of a label: up to 200 changes, newest first."""
        with refusing():
            return JSONResponse([history_json(entry) for entry in desk.labels.log.history(kind, number)])

    return router
