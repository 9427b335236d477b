"""The OpenAPI description: a summary for each route, and the errors that requests can return."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse, Response

from app.web.routes.shapes.common import Refusal

REFUSALS: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "model": Refusal,
        "description": "Refused; nothing was changed: 401 token missing · 403 cross-origin, or not allowed for "
        "this role · 404 not found, or not yet · 409 conflicts with the present state · 413 too large · 422 invalid",
    }
}
"""Errors that every route may return. Listing them removes the framework's own 422 schema, which is not used here."""


def titled(app: FastAPI) -> Callable[[], dict[str, Any]]:
    """Replacement for ``app.openapi``: uses the first sentence of a route's docstring as its title, instead of the
    function's name."""
    plain = app.openapi

    def described() -> dict[str, Any]:
        whole = plain()
        for methods in whole["paths"].values():
            for operation in methods.values():
                operation["summary"] = _first_sentence(operation["description"])
        return whole

    return described


def described_by(app: FastAPI) -> Callable[[], Response]:
    """The route of the description. The framework's own makes it on the event loop, which takes half a second of
    processor time, in which no health check is answered and no frame sent."""
    alone, made = threading.Lock(), list[bytes]()

    def describe() -> Response:
        with alone:
            if not made:
                made.append(bytes(JSONResponse(app.openapi()).body))
        return Response(made[0], media_type="application/json")

    return describe


def _first_sentence(text: str) -> str:
    for end in (". ", "; ", ": "):
        text = text.partition(end)[0]
    return " ".join(text.split()).removesuffix(".")
