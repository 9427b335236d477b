"""The documentation in ``docs/`` as HTML pages, rendered from the same files as in the repository.

``docs/README.md`` lists the pages with their headings and order; this list becomes the sidebar.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Sequence
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

if TYPE_CHECKING:
    from markdown_it import MarkdownIt
    from markdown_it.token import Token

DOCS = Path(__file__).resolve().parents[2] / "docs"
INDEX = "README.md"
_PAGE = ".md"
_NUMBER_AND_UNIT = re.compile(r"(?<=\d) (?=(?:%|°|k?m(?:/h|/s²?)?|cm|px|ms|s|Hz|[kMG]B)(?!\w))")
"""The space between a number and its unit, where no line may break."""


class PageHeading(NamedTuple):
    """A heading of a page."""

    level: int
    """1 is the page's title"""
    text: str
    """Plain text without markup"""
    anchor: str
    """Fragment of a link to it, after ``#``"""


class HelpPage(NamedTuple):
    """A rendered page, without the frame around it."""

    title: str
    """Text of its first heading."""
    body: str
    """HTML."""
    headings: tuple[PageHeading, ...]
    """For the page's own table of contents."""


class NavGroup(NamedTuple):
    """A heading of the sidebar with its links: (file below ``docs/``, words)."""

    title: str
    """Of the group."""
    links: tuple[tuple[str, str], ...]
    """File below ``docs/`` and words."""


def files() -> dict[str, Path]:
    """Every documentation file by its path below ``docs/``. Requested names are looked up here, so that no request can
    access another file."""
    return {path.relative_to(DOCS).as_posix(): path for path in sorted(DOCS.rglob("*")) if path.is_file()}


def page_of(address: str) -> str:
    """The file for an address below ``/help/``: ``guides/drive`` is ``guides/drive.md``, an empty address is the
    index."""
    return f"{address.removesuffix(_PAGE)}{_PAGE}" if address else INDEX


def address_of(file: str) -> str:
    """The address below ``/help/`` of a page's file; the inverse of ``page_of``."""
    return "" if file == INDEX else file.removesuffix(_PAGE)


def render(text: str, file: str) -> HelpPage:
    """Render a page. ``file``: its path below ``docs/``; links are relative to it."""
    tokens = _parser().parse(text)
    headings = tuple(_anchored(tokens))
    for token in tokens:
        children = token.children or []
        for index, child in enumerate(children):
            if child.type == "text":
                child.content = _NUMBER_AND_UNIT.sub("\u00a0", child.content)
            elif child.type == "link_open":
                _point(child, next(each for each in children[index:] if each.type == "link_close"), file)
    body = _parser().renderer.render(tokens, _parser().options, {})
    title = next((each.text for each in headings if each.level == 1), file)
    body = str(body).replace("<table>", '<div class="wide"><table>').replace("</table>", "</table></div>")
    return HelpPage(title, body, headings)


def navigation(text: str) -> tuple[NavGroup, ...]:
    """The sidebar, from the index page's text: its second-level headings and the links of the lists below them."""
    groups: list[NavGroup] = []
    tokens = _parser().parse(text)
    for index, token in enumerate(tokens):
        if token.type == "heading_open" and token.tag == "h2":
            groups.append(NavGroup(_words(tokens[index + 1].children or ()), ()))
        elif token.type == "inline" and token.level == 3 and groups:
            links = tuple(_links(token.children or ()))[:1]
            groups[-1] = groups[-1]._replace(links=groups[-1].links + links)
    return tuple(group for group in groups if group.links)


def html_page(page: HelpPage, nav: Sequence[NavGroup], file: str) -> str:
    """The whole document: the page and its sidebar."""
    name = "CIPV Studio" if file == INDEX else f"{page.title} · CIPV Studio"
    items = "".join(_nav_group(group, page, file) for group in nav)
    return f"""<!doctype html>
<html lang="en">
<head>
  <meta charset="utf-8">
  <meta name="viewport" content="width=device-width, initial-scale=1">
  <meta name="color-scheme" content="dark light">
  <title>{escape(name)}</title>
  <link rel="icon" href="/icon.svg" type="image/svg+xml">
  <link rel="stylesheet" href="/css/base.css">
  <link rel="stylesheet" href="/docs/docs.css">
  <script src="/docs/theme.js"></script>
</head>
<body class="docs">
  <header class="docs-bar">
    <a class="docs-home" href="/help/"><img src="/icon.svg" alt="" width="18" height="18"> CIPV Studio help</a>
    <a class="docs-contents" href="#contents">Contents</a>
    <a href="/">Dashboard</a>
  </header>
  <div class="docs-columns">
    <main>
{page.body}
    </main>
    <nav id="contents" aria-label="Pages">
      <p><a href="/help/"{_current(file == INDEX)}>Overview</a></p>
{items}
    </nav>
  </div>
</body>
</html>
"""


def not_found(address: str) -> HelpPage:
    """The page for an unknown address."""
    said = escape(address)
    body = (
        f"<h1>Page not found</h1>\n<p>There is no help page named <code>{said}</code>.</p>\n"
        '<p>The list of pages is in the contents, and on the <a href="/help/">overview</a>.</p>'
    )
    return HelpPage("Page not found", body, ())


def slug(text: str) -> str:
    """The anchor of a heading as generated by GitHub: lower case, spaces as hyphens, no other punctuation."""
    return re.sub(r"[^\w\- ]", "", text.strip().lower()).replace(" ", "-")


@cache
def _parser() -> MarkdownIt:
    from markdown_it import MarkdownIt  # imported on the first help request, to keep the server's start fast

    return MarkdownIt("commonmark", {"html": False}).enable("table")


def _anchored(tokens: Sequence[Token]) -> Iterator[PageHeading]:
    """The headings; adds an anchor to each opening token, numbered for repeated headings."""
    taken: dict[str, int] = {}
    for index, token in enumerate(tokens):
        if token.type != "heading_open":
            continue
        text = _words(tokens[index + 1].children or ())
        anchor = slug(text)
        taken[anchor] = taken.get(anchor, -1) + 1
        if taken[anchor]:
            anchor = f"{anchor}-{taken[anchor]}"
        token.attrSet("id", anchor)
        yield PageHeading(int(token.tag[1:]), text, anchor)


def _words(tokens: Sequence[Token]) -> str:
    return "".join(token.content for token in tokens if token.type in ("text", "code_inline"))


def _links(tokens: Sequence[Token]) -> Iterator[tuple[str, str]]:
    """(target, words) of the links in a line."""
    for index, token in enumerate(tokens):
        if token.type == "link_open":
            yield str(token.attrGet("href")), tokens[index + 1].content


def _point(link: Token, end: Token, file: str) -> None:
    """Convert a link between Markdown files to one between help pages. Files outside ``docs/``, such as source code,
    are not served: the link text stays, without a link."""
    target = urlsplit(str(link.attrGet("href")))
    if target.scheme or not target.path:
        return
    path = posixpath.normpath(posixpath.join(posixpath.dirname(file), target.path))
    if path.startswith(".."):
        link.tag = end.tag = "span"
        link.attrs = {"title": path.lstrip("./")}
    elif path.endswith(_PAGE):
        anchor = f"#{target.fragment}" if target.fragment else ""
        link.attrSet("href", f"/help/{address_of(path)}{anchor}")


def _nav_group(group: NavGroup, page: HelpPage, file: str) -> str:
    rows = []
    for target, words in group.links:
        is_here = target == file
        inside = "".join(
            f'<li><a href="#{each.anchor}">{escape(each.text)}</a></li>' for each in page.headings if each.level == 2
        )
        below = f"<ul>{inside}</ul>" if is_here and inside else ""
        rows.append(f'<li><a href="/help/{address_of(target)}"{_current(is_here)}>{escape(words)}</a>{below}</li>')
    return f"      <h2>{escape(group.title)}</h2>\n      <ul>{''.join(rows)}</ul>\n"


def _current(is_here: bool) -> str:
    return ' aria-current="page"' if is_here else ""
