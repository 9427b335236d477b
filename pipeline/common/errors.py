"""What a person did or gave that cannot work, as opposed to a fault of ours."""

from __future__ import annotations


class BadInput(Exception):
    """The text is one sentence for a person: what is wrong with which file, name or value, and the remedy if there is
    one. The command line prints it and exits with 2; the page shows it as a notice."""
