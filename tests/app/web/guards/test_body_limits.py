"""Every route says how much it takes at most, and refuses more before it reads a byte."""

from __future__ import annotations

import asyncio
import re

import httpx
from fastapi import FastAPI

from app.engine.engine import Engine
from app.web.guards.limits import LARGEST_BODY, LARGEST_FILE
from app.web.routes.labels.files import IMPORT
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener


def described_limits(app: FastAPI) -> dict[tuple[str, str], int]:
    """The most bytes that each route takes, by method and path: of a file where one is expected."""
    found = {}
    for path, methods in app.openapi()["paths"].items():
        for method, operation in methods.items():
            content = operation.get("requestBody", {}).get("content", {"application/json": {}})
            found[method.upper(), path] = max(
                LARGEST_BODY if kind == "application/json" else each["schema"]["maxLength"]
                for kind, each in content.items()
            )
    return found


def test_every_route_refuses_more_than_it_says() -> None:
    """Those with another limit than all others are the uploads."""
    app = create_app(Engine(opener(Recording()), None, Params()))
    limits = described_limits(app)
    assert len(limits) > 60
    assert {key: most for key, most in limits.items() if most != LARGEST_BODY} == {("POST", IMPORT): LARGEST_FILE}

    async def answers() -> dict[tuple[str, str], tuple[int, str]]:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            found = {}
            for (method, path), most in limits.items():
                headers = {"content-length": str(most + 1), "content-type": "application/json"}
                answer = await client.request(method, re.sub(r"{[^}]*}", "1", path), headers=headers, content=b"{}")
                found[method, path] = answer.status_code, answer.text
            return found

    said = {key: (413, f'{{"detail":"the request is larger than {most >> 20} MiB"}}') for key, most in limits.items()}
    assert asyncio.run(answers()) == said
