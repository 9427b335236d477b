"""/api/account: who the client is signed in as."""

from __future__ import annotations

from fastapi import APIRouter, Request

from app.core.client_role import AccountRole, account_of
from app.web.routes.shapes.common import ApiModel


class AccountJson(ApiModel):
    """The client's account."""

    name: str | None
    """Under which its labels are stored; null without an account: then each request names a person."""
    role: AccountRole | None
    """labeler, reviewer or admin; null without an account: then everything is allowed."""


def account_router() -> APIRouter:
    """Route about the client itself."""
    router = APIRouter(prefix="/api", tags=["labels"])

    @router.get("/account")
    def account(request: Request) -> AccountJson:
        """Tell who the client is signed in as, by its personal token."""
        found = account_of(request)
        return AccountJson(name=found.name if found else None, role=found.role if found else None)

    return router
