"""/api/project: project cuboids to the shown image and cast rays from its pixels, for drawing cuboids in the page."""

from __future__ import annotations

import numpy as np
from fastapi import APIRouter
from pydantic import ConfigDict, Field

from app.core.request_shapes import CuboidShape, Finite
from app.engine.engine import Engine
from app.web.routes.shapes.common import ApiModel
from pipeline.alignment.projection import resolve
from pipeline.common.geometry import corners_of

MOST_CUBOIDS = 500

Pixel = tuple[float, float]


class Given(ApiModel):
    """Cuboids of one frame."""

    model_config = ConfigDict(extra="forbid")

    cuboids: list[CuboidShape] = Field(max_length=MOST_CUBOIDS)
    """In the ego frame."""


class Projected(ApiModel):
    """The corners of cuboids in the image."""

    pixels: list[list[Pixel | None]] | None
    """For each cuboid the pixels of its 8 corners in the original image, the bottom four first; null for a corner
    behind the camera. Null as a whole without an extrinsic calibration of LiDAR and camera."""


class GivenPixel(ApiModel):
    """A pixel of the original image."""

    model_config = ConfigDict(extra="forbid")

    pixel: tuple[Finite, Finite]
    """Column and row."""


class Ray(ApiModel):
    """The viewing ray of a pixel, ego frame. Null without an extrinsic calibration."""

    start: tuple[float, float, float] | None
    """Where the camera is."""
    toward: tuple[float, float, float] | None
    """Direction, of any length."""


def project_router(engine: Engine) -> APIRouter:
    """Routes for the shown frame's camera and the current alignment."""
    router = APIRouter(prefix="/api", tags=["alignment"])

    @router.post("/project")
    def project(body: Given) -> Projected:
        """Project cuboids to the shown image with the present parameters."""
        shown = engine.snapshot
        processed = shown.processed
        aligned = resolve(shown.params.alignment, processed.frame.camera) if processed is not None else None
        if aligned is None:
            return Projected(pixels=None)
        if not body.cuboids:
            return Projected(pixels=[])
        corners = corners_of([each.value() for each in body.cuboids])
        pixels = np.round(aligned.project(corners.reshape(-1, 3)), 2).tolist()
        seen = [(u, v) if np.isfinite((u, v)).all() else None for u, v in pixels]
        return Projected(pixels=[seen[start : start + 8] for start in range(0, len(seen), 8)])

    @router.post("/project/ray")
    def ray(body: GivenPixel) -> Ray:
        """Get the viewing ray of a pixel in the shown image with the present parameters."""
        shown = engine.snapshot
        aligned = resolve(shown.params.alignment, shown.processed.frame.camera) if shown.processed is not None else None
        if aligned is None:
            return Ray(start=None, toward=None)
        start, (toward,) = aligned.rays(np.array([body.pixel]))
        return Ray(start=tuple(start.tolist()), toward=tuple(toward.tolist()))

    return router
