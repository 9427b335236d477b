"""/healthz and /metrics: for who watches over the server."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter, Response
from prometheus_client import CONTENT_TYPE_LATEST
from pydantic import BaseModel

from app.engine.engine import Engine
from app.web.metrics import Metrics


class Health(BaseModel):
    """engine: false when the worker has ended, of which nothing recovers but a new start."""

    status: Literal["ok", "failed"]
    engine: bool


def health_router(engine: Engine, metrics: Metrics) -> APIRouter:
    """Routes for supervisors and for Prometheus."""
    router = APIRouter(tags=["health"])

    @router.get("/healthz", responses={503: {"model": Health, "description": "The worker has ended"}})
    @router.get("/api/healthz", responses={503: {"model": Health, "description": "The worker has ended"}})
    def healthz(response: Response) -> Health:
        """Whether the server and its worker live: 200, else 503. /healthz needs no token."""
        if engine.alive:
            return Health(status="ok", engine=True)
        response.status_code = 503
        return Health(status="failed", engine=False)

    @router.get("/metrics", response_class=Response, responses={200: {"content": {"text/plain": {}}}})
    def read() -> Response:
        """Figures in Prometheus' text format. Where tokens are needed, Prometheus sends one as its bearer token."""
        return Response(metrics.render(), media_type=CONTENT_TYPE_LATEST)

    return router
