"""/api/alignment/import and /api/alignment/export: camera calibrations of other tools. An import changes nothing; the
client applies the result."""

from __future__ import annotations

import io
import tempfile
import zipfile
from pathlib import Path, PurePath
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from pydantic import ConfigDict, Field

from app.engine.engine import Engine
from app.web.refusals import refusing
from app.web.routes.alignment.shown import shown_frame
from app.web.routes.shapes.common import ApiModel, file_of
from pipeline.alignment.convert import calibration_in_use
from pipeline.calibration.imported import imported
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES
from pipeline.formats.calibration_files import write_calibration
from pipeline.formats.calibration_files.recognise import parse_any
from pipeline.types.source import lidar_frame

MOST_FILES = 4
FormatName = Literal["kitti", "ros", "opencv", "kalibr", "rig"]
_SUFFIXES = {"kitti": ".txt", "opencv": ".yaml", "rig": ".yaml"}
"""Of single files; a format with several is a .zip."""


class CalibrationText(ApiModel):
    """One file of a calibration."""

    model_config = ConfigDict(extra="forbid")

    name: str = Field(min_length=1, max_length=255, description="Its name, for messages")
    text: str = Field(max_length=LARGEST_TEXT_BYTES, description="Its content")


class GivenCalibration(ApiModel):
    """The files of one calibration."""

    model_config = ConfigDict(extra="forbid")

    files: list[CalibrationText] = Field(min_length=1, max_length=MOST_FILES)
    """KITTI: one, or calib_cam_to_cam.txt and calib_velo_to_cam.txt; OpenCV: one; ROS: camera info and static
    transform; Kalibr: camera chain, and the file with T_cam_lidar unless the chain contains it."""


class ImportJson(ApiModel):
    """A calibration as alignment parameters."""

    format: str
    """Title of the format, as recognised."""
    changes: dict[str, float | str]
    """Parameters by dotted name, as PATCH /api/params takes them."""
    text: str
    """What they are, in a sentence."""
    warnings: list[str]
    """What is not as in the file, or looks wrong."""


def alignment_files_router(engine: Engine) -> APIRouter:
    """Routes for calibration files."""
    router = APIRouter(prefix="/api/alignment", tags=["alignment"])

    @router.post("/import")
    def read(body: GivenCalibration) -> ImportJson:
        """Read a calibration of KITTI, ROS, OpenCV or Kalibr as parameters of the current alignment model. 404 when
        nothing is shown, 409 with the likely mistake for a file that cannot be used."""
        (frame, size), mount = shown_frame(engine), lidar_frame(engine.source)
        given: dict[str, bytes] = {}
        for each in body.files:
            given[PurePath(each.name).name or each.name] = each.text.encode()
        with refusing():
            chosen, camera = parse_any(given, size, mount)
            found = imported(camera, engine.control.peek().params.alignment, frame.camera, size, mount)
        return ImportJson(
            format=chosen.title,
            changes={f"alignment.{name}": value for name, value in found.values.items()},
            text=found.text,
            warnings=list(found.warnings),
        )

    @router.get("/export", response_class=Response, responses=file_of("application/octet-stream"))
    def write(format: Annotated[FormatName, Query(description="Of the file to write")]) -> Response:
        """Download the calibration with the current alignment; a .zip for ROS and Kalibr, which have two files. 404
        when nothing is shown, 409 if the format cannot represent it."""
        (frame, size), mount = shown_frame(engine), lidar_frame(engine.source)
        with refusing(), tempfile.TemporaryDirectory() as folder:
            camera = calibration_in_use(engine.control.peek().params.alignment, frame.camera, size)
            path = Path(folder) / "calibration"
            write_calibration(path, format, camera, mount)
            data = path.read_bytes() if path.is_file() else _zipped(path)
        name = f"cipv-{format}{_SUFFIXES.get(format, '.zip')}"
        headers = {"content-disposition": f'attachment; filename="{name}"'}
        return Response(data, media_type="application/octet-stream", headers=headers)

    return router


def _zipped(folder: Path) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in sorted(folder.iterdir()):
            packed.write(file, file.name)
    return data.getvalue()
