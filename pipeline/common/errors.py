"""Errors caused by what the user did or provided, as opposed to bugs."""

from __future__ import annotations


class BadInput(Exception):
    """The text is one sentence for the user: what is wrong with which file, name or value, and the remedy if there is
    one. The command line prints it and exits with 2; the page shows it as a notice."""


def first_line(error: BaseException | None) -> str:
    """The first line of another library's error message."""
    return (str(error).strip().splitlines() or ["no reason given"])[0]
