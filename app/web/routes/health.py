"""/healthz and /metrics: for monitoring."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST

from app.engine.engine import Engine
from app.web.metrics import Metrics
from app.web.routes.shapes.common import ApiModel


class Health(ApiModel):
    """Whether the server and its worker run."""

    status: Literal["ok", "failed"]
    """``failed`` is sent with status 503."""
    engine: bool
    """False when the worker thread has ended; only a restart of the server helps."""


def health_router(engine: Engine, metrics: Metrics) -> APIRouter:
    """Routes for process supervisors and Prometheus."""
    router = APIRouter(tags=["health"])

    @router.head("/healthz", include_in_schema=False)
    @router.get("/healthz", responses={503: {"model": Health, "description": "The worker has ended"}})
    @router.get("/api/healthz", responses={503: {"model": Health, "description": "The worker has ended"}})
    async def healthz(response: Response) -> Health:
        """Check whether the server and its worker are alive: 200, otherwise 503. Needs no token."""
        if engine.alive:
            return Health(status="ok", engine=True)
        response.status_code = 503
        return Health(status="failed", engine=False)

    @router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
    def read() -> Response:
        """Get metrics in Prometheus' text format. Where tokens are required, send one as the bearer token."""
        return Response(metrics.render(), media_type=CONTENT_TYPE_LATEST)

    return router
