"""What a terminal may be told. Titles, notes and file names come from recordings, whose authors may put control
sequences in them: these could rewrite what was printed, or what the clipboard holds (OSC 52)."""

from __future__ import annotations

import re
import sys
from typing import Any

_OURS = r"\x1b\[[0-9;]*[mAGK]|\x1b\[\?25[hl]|\x1b\]8;[^\x00-\x1f\x7f-\x9f]*\x1b\\"
"""Colours, cursor up and erase line (progress bars), cursor on and off, links: what rich writes."""
_CONTROLS = re.compile(rf"({_OURS})|[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
_LINE_CONTROLS = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")


def one_line(text: object) -> str:
    """A text with all control characters, and so all line breaks, as escapes such as ``\\x1b``."""
    return _LINE_CONTROLS.sub(_escaped, str(text))


class SafeTerminal:
    """A text stream of a terminal that writes control characters as escapes, apart from those that colour text, draw
    progress bars and make links."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(_CONTROLS.sub(lambda found: found[1] or _escaped(found), text))
        return len(text)

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def make_safe() -> None:
    """Replace ``sys.stdout`` and ``sys.stderr`` where they are terminals. Characters that cannot be encoded, such as
    those of file names that are no UTF-8, are written as escapes by both."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
        if stream is not None and stream.isatty() and not isinstance(stream, SafeTerminal):
            setattr(sys, name, SafeTerminal(stream))


def _escaped(found: re.Match[str]) -> str:
    return found[0].encode("unicode_escape").decode()
