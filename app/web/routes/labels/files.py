"""/api/labels/export, import and versions: labels as files, and frozen label sets."""

from __future__ import annotations

import asyncio
import os
import shutil
import tempfile
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from starlette.background import BackgroundTask
from starlette.requests import ClientDisconnect

from app.labels.acts.request_fields import Person
from app.labels.service.desk import LabelDesk
from app.labels.store.values import LONGEST_ITEM, LONGEST_NAME
from app.labels.wording import WORKING
from app.web.guards.limits import LARGEST_FILE
from app.web.refusals import refusing
from app.web.routes.labels.act_shapes import TaskBegun
from app.web.routes.labels.file_shapes import (
    VERSION_NAME,
    AgreementJson,
    FormatJson,
    LostJson,
    NativeFile,
    NewVersion,
    VersionJson,
)
from app.web.routes.shapes.common import file_of
from pipeline.labels.classes import as_written
from pipeline.labels.formats.registry import FORMATS, FormatName
from pipeline.labels.selection import Selection, selected

IMPORT = "/api/labels/import"
_BYTES = "application/octet-stream"
_FILE = file_of(_BYTES)
_UPLOADED = {"type": "string", "format": "binary", "maxLength": LARGEST_FILE}
_TAKES_A_FILE = {"requestBody": {"required": True, "content": {_BYTES: {"schema": _UPLOADED}}}}
"""OpenAPI description of the body, which the framework cannot infer because it is read in chunks."""
VersionName = Annotated[str, Query(max_length=LONGEST_NAME, pattern=VERSION_NAME)]


def label_files_router(desk: LabelDesk) -> APIRouter:
    """Routes for label files."""
    router = APIRouter(prefix="/api/labels", tags=["labels"])

    @router.post("/import", status_code=202, responses={202: {"model": TaskBegun}}, openapi_extra=_TAKES_A_FILE)
    async def take(
        request: Request,
        person: Annotated[Person, Query()],
        drive: Annotated[str, Query(max_length=LONGEST_ITEM)],
        format: FormatName = "native",
    ) -> Response:
        """Import labels that another tool wrote. The body is the file, or a .zip of the folder. They are added to the
        labels that exist, as one act; state.labels.task has the progress. drive: id of the recording; 409 when another
        one is open."""
        path = await asyncio.to_thread(_new_file)
        try:
            file = await asyncio.to_thread(path.open, "wb")
            try:
                async for piece in request.stream():
                    await asyncio.to_thread(file.write, piece)
            finally:
                await asyncio.to_thread(file.close)
            with refusing():
                number = await asyncio.to_thread(desk.begin_import, person, path, format, drive)
        except BaseException as error:
            await asyncio.to_thread(path.unlink, missing_ok=True)
            # nobody receives the response, but it is not an error of this program
            if isinstance(error, ClientDisconnect):
                raise HTTPException(400, "the upload was incomplete") from None
            raise
        return JSONResponse({"status": "begun", "what": "import", "task": number}, 202)

    @router.get("/formats")
    def formats() -> list[FormatJson]:
        """List the formats in which labels can be exported and imported."""
        return [FormatJson(name=each.name, title=each.title, about=each.about) for each in FORMATS.values()]

    @router.get("/export", response_class=FileResponse, responses=_FILE)
    def export(format: FormatName = "native", version: VersionName = WORKING, only: Selection = "all") -> FileResponse:
        """Download labels as a file, or as a .zip for a format that is a folder. only: those that are accepted, or
        reviewed; the file's name and the set's say which. The header X-Cipv-Lost counts the
        kinds of information that the format cannot express; /api/labels/export/notes lists them."""
        # imports the libraries of the formats, so only when labels are exchanged
        from app.labels.transfer.files import exported

        with refusing():
            made = exported(desk.recording, desk.labels.label_set(version), format, only, desk.classes)
        return FileResponse(
            made.file,
            filename=made.file.name,
            media_type=_BYTES,
            headers={"x-cipv-lost": str(len(made.lost))},
            background=BackgroundTask(shutil.rmtree, made.folder, ignore_errors=True),
        )

    @router.get("/export/notes")
    def notes(format: FormatName = "native", version: VersionName = WORKING, only: Selection = "all") -> LostJson:
        """List what a format cannot express, one sentence each, before exporting."""
        from pipeline.labels.formats.parts import reduce

        with refusing():
            labels, renamed = as_written(selected(desk.labels.label_set(version), only), desk.classes, format)
            _, lost = reduce(labels, FORMATS[format].holds)
        return LostJson(lost=[*lost, *renamed])

    @router.get("/versions", responses={200: {"model": list[VersionJson]}})
    def versions() -> Response:
        """List frozen label sets, oldest first."""
        with refusing():
            return JSONResponse([vars(version) for version in desk.labels.versions()])

    @router.post("/versions", status_code=201)
    def freeze(body: NewVersion) -> VersionJson:
        """Freeze all labels as they are now under a name. 409 when the name is taken."""
        with refusing():
            return VersionJson(**vars(desk.labels.freeze(body.name, body.person)))

    @router.get("/agreement")
    def agreement_of(
        first: Annotated[str, Query(max_length=LONGEST_NAME)],
        second: Annotated[str, Query(max_length=LONGEST_NAME)] = WORKING,
    ) -> AgreementJson:
        """Compare two versions of the recording's labels, or one with the labels as they are now."""
        from pipeline.labels.agreement import agreement

        with refusing():
            one, other = (desk.labels.label_set(each) for each in (first, second))
            found = agreement(one, other)
        return AgreementJson(**(vars(found) | {"lead_disagreements": list(found.lead_disagreements)}))

    @router.get("/versions/{name}", responses={200: {"model": NativeFile}})
    def version(name: str) -> Response:
        """Download a frozen label set in the native format."""
        with refusing():
            return Response(desk.labels.version_json(name), media_type="application/json")

    return router


def _new_file() -> Path:
    """An empty temporary file that only this user can read; the caller must remove it."""
    handle, name = tempfile.mkstemp(prefix="cipv-upload-")
    os.close(handle)
    return Path(name)
