"""Nobody acts under the name of somebody else: checked for all routes at once, so that a new one is covered too."""

from __future__ import annotations

import json
from typing import Any

from starlette.requests import HTTPConnection, Request

from app.core.client_role import account_of
from app.labels.acts.request_fields import clean
from app.labels.permissions import check_name
from app.web.refusals import refusing

_NAME = "person"
"""The field and query parameter in which requests name a person."""


async def own_name(connection: HTTPConnection) -> None:
    """Dependency of all routes: 403 if the request of an account names another person. The name is cleaned as the
    routes do it."""
    account = account_of(connection)
    if account is None:
        return
    named: list[Any] = connection.query_params.getlist(_NAME)
    if isinstance(connection, Request) and "json" in connection.headers.get("content-type", "").lower():
        named.append(await _in_body(connection))
    with refusing():
        for each in named:
            check_name(account, clean(each) if isinstance(each, str) else "")


async def _in_body(request: Request) -> Any:
    """The name in a JSON body; None if there is none. An invalid body is refused by the route."""
    try:
        body = json.loads(await request.body())
    except (ValueError, RecursionError):
        return None
    return body.get(_NAME) if isinstance(body, dict) else None
