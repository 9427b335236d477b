"""What accounts may do with labels, where it depends on the request's content. ``app.web.guards.access`` has the rules
by address.

A labeler labels, and takes recordings from the queue. A reviewer also approves labels and sends them back, marks
recordings as done, imports labels, freezes versions, and sees the results of control frames. An admin also assigns
recordings to others, and marks them as done although labels are left to review. A client without an account may do
everything, under any name.
"""

from __future__ import annotations

from collections.abc import Mapping

from app.core.client_role import Account, AccountRole, includes
from app.labels.errors import NotAllowed
from app.labels.work_states import State

ACT_ROLES: Mapping[str, AccountRole] = {
    "review_ok": "reviewer",
    "send_back": "reviewer",
    "import": "reviewer",
    "clear_all": "reviewer",
}
"""The role that an act needs; without an entry, every account may do it. Import: a labeler would import the truth of
control frames. Clear: who may freeze versions, which it follows."""


def check_name(account: Account | None, person: str) -> None:
    """Nobody acts under the name of somebody else. NotAllowed if an account does."""
    if account is not None and person not in ("", account.name):
        raise NotAllowed(f"you are signed in as {account.name}, not as {person}")


def check_act(account: Account | None, kind: str) -> None:
    """NotAllowed if the account's role does not include the act."""
    needed = ACT_ROLES.get(kind)
    if needed is not None and not includes(account, needed):
        raise NotAllowed(f"requires the role {needed}")


def check_work(
    account: Account | None, assigned: str, person: str | None, state: State | None, *, anyway: bool = False
) -> None:
    """NotAllowed if the account may not change a recording of the queue so. assigned: its present assignee; person: the
    new one, empty for nobody; None to leave it. anyway: whether labels may be left to review."""
    if anyway and not includes(account, "admin"):
        raise NotAllowed("requires the role admin")
    if state == "done" and not includes(account, "reviewer"):
        raise NotAllowed("requires the role reviewer")
    if person is None or account is None or includes(account, "admin"):
        return
    if person not in ("", account.name) or assigned not in ("", account.name):
        raise NotAllowed("requires the role admin")
