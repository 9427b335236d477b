"""`cipv accounts`: the people who may label on this server, each with a token and a role."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Annotated

from app.commands.support.arguments import option
from app.core.client_role import AccountRole
from pipeline.common.errors import BadInput


@dataclass(frozen=True)
class ListAccounts:
    """List the accounts of people who label on this server. With --add: create one, and print its token, which is not
    stored anywhere; the person opens the server's link with it. A running server notices changes.

    Example: cipv accounts --add Ada --role labeler
    """

    add: Annotated[str | None, option("NAME")] = None
    """Create an account, or give an existing one a new token and role"""
    role: Annotated[AccountRole | None, option("labeler|reviewer|admin")] = None
    """labeler: labels. reviewer: also approves labels and imports. admin: also assigns recordings to others"""
    remove: Annotated[str | None, option("NAME")] = None
    """Remove an account; its labels stay"""

    def __call__(self) -> int:
        from app.web.guards.accounts import add_account, read_accounts, remove_account

        if (self.add is None) != (self.role is None):
            raise BadInput("--add and --role must be given together")
        if self.remove is not None:
            remove_account(self.remove)
        if self.add is not None and self.role is not None:
            print(f"token of {self.add}, shown only once: {add_account(self.add, self.role)}")
            print("To sign in, open the server's address with /?token=TOKEN", file=sys.stderr)
            return 0
        for each in read_accounts():
            print(f"{each.name}: {each.role}")
        return 0
