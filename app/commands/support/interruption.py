"""What a command says when it is interrupted."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def says_when_interrupted(how_to_continue: str) -> Iterator[None]:
    """If Ctrl-C or another signal to stop ends the block, print how the work is continued, in one line."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"cipv: interrupted; {how_to_continue}", file=sys.stderr)
        raise
