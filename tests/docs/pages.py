"""Every Markdown file of the documentation, and its content."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FILES = sorted(
    path.relative_to(ROOT).as_posix()
    for pattern in ("*.md", "docs/**/*.md", "sessions/README.md", "pipeline/**/*.md", "app/**/*.md")
    for path in ROOT.glob(pattern)
)
_PROGRAM = ("cipv", ".venv/bin/cipv")


class Link(NamedTuple):
    """A link or image."""

    target: str
    is_image: bool


@cache
def tokens(file: str) -> tuple[Token, ...]:
    """The parsed file, given its path from the root."""
    parser = MarkdownIt("commonmark").enable("table")
    return tuple(parser.parse((ROOT / file).read_text(encoding="utf-8")))


def links(file: str) -> Iterator[Link]:
    for child in _inside(file):
        if child.type == "link_open":
            yield Link(str(child.attrGet("href")), False)
        elif child.type == "image":
            yield Link(str(child.attrGet("src")), True)


def code_spans(file: str) -> Iterator[str]:
    """Texts in backticks."""
    return (child.content for child in _inside(file) if child.type == "code_inline")


def block_commands(file: str) -> Iterator[list[str]]:
    """Every `cipv` command of a code block, as the words after the program's name."""
    for token in tokens(file):
        if token.type in ("code_block", "fence"):
            for line in token.content.splitlines():
                yield from _commands(line)


def span_commands(file: str) -> Iterator[list[str]]:
    """The same for commands in backticks, which may be only the beginning of a command."""
    for span in code_spans(file):
        yield from _commands(span)


def _commands(line: str) -> Iterator[list[str]]:
    if not line.strip().startswith(_PROGRAM):
        return
    words: list[str] = []
    for word in (*shlex.split(line, comments=True), "&&"):
        if word in ("&&", "|", ">", "…"):
            if words and words[0] in _PROGRAM:
                yield words[1:]
            words = []
        else:
            words.append(word)


def _inside(file: str) -> Iterator[Token]:
    return (child for token in tokens(file) for child in token.children or ())
