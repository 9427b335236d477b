"""The OpenAPI description: a summary for each route, and the errors that requests can return."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastapi import FastAPI

from app.web.routes.shapes.common import Refusal

REFUSALS: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "model": Refusal,
        "description": "Refused; nothing was changed: 401 token missing · 403 cross-origin, or not allowed for "
        "this role · 404 not found, or not yet · 409 conflicts with the present state · 413 too large · 422 invalid",
    }
}
"""What every route may answer. Naming it takes the framework's own form of a 422 away, which nothing here sends."""


def titled(app: FastAPI) -> Callable[[], dict[str, Any]]:
    """Instead of ``app.openapi``: a route is called by its docstring's first sentence, not by its function's name."""
    plain = app.openapi

    def described() -> dict[str, Any]:
        whole = plain()
        for methods in whole["paths"].values():
            for operation in methods.values():
                operation["summary"] = _first_sentence(operation["description"])
        return whole

    return described


def _first_sentence(text: str) -> str:
    for end in (". ", "; ", ": "):
        text = text.partition(end)[0]
    return " ".join(text.split()).removesuffix(".")
