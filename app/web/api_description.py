"""The API's description: a title for each route, and how it refuses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fastapi import FastAPI

from app.web.routes.shapes import Refusal

REFUSALS: dict[int | str, dict[str, Any]] = {
    "4XX": {
        "model": Refusal,
        "description": "Refused, and nothing was changed: 401 without a token · 403 to another website, or to a role "
        "that may not · 404 there is no such thing, or not yet · 409 not as things are now · 413 too large · 422 not "
        "understood",
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
