"""The page's files. A browser asks for a page each time and for its scripts and styles once: their addresses contain a
hash of their content, so an opening takes a few requests instead of one per file, and an update is never half applied.

Scripts import each other by plain paths. An import map in the page (https://html.spec.whatwg.org/#import-maps) leads
these to the addresses with a hash; a browser without import maps asks about each file again.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
from base64 import b64encode
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from hashlib import blake2b, sha256
from mimetypes import guess_type
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import parse_qs

from fastapi.responses import HTMLResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.staticfiles import NotModifiedResponse
from starlette.types import Scope

from app.web.guards.access import page_policy

STATIC = Path(__file__).resolve().parents[2] / "static"
_DISPLAY, _ITS_FOLDER = "drive", "incar"
"""The in-vehicle page is served as ``/drive/``."""
_REFERENCE = re.compile(r'(?<= )(href|src)="([^"?#:]+\.(?:js|css|svg))"')
_FIRST_MODULE = re.compile(r'^ *<script type="module"', re.MULTILINE)
_STAYS = "max-age=31536000, immutable"
"""A year, the longest that HTTP caches are asked to keep something (RFC 9111)."""


class _File(NamedTuple):
    stamp: tuple[int, int]
    """Time of change in ns, and size in bytes."""
    content: bytes
    version: str
    """Hash of the content."""


class PageFiles(StaticFiles):
    """Static files. on_ask: called for each request, because a user waits for a page.

    Pages are put together on a thread of their own, one at a time: that looks at every script, and the event loop
    answers health checks and sends frames."""

    def __init__(self, on_ask: Callable[[], object], folder: Path = STATIC) -> None:
        super().__init__(directory=folder, html=True)
        self._on_ask = on_ask
        self._folder = folder
        self._held: dict[str, _File] = {}
        self._thread = ThreadPoolExecutor(1, "cipv-pages")

    async def get_response(self, path: str, scope: Scope) -> Response:
        """A page with the current addresses of its files, or a file."""
        self._on_ask()
        name, response = _file_of(path), None
        if scope["method"] in ("GET", "HEAD"):
            response = await asyncio.get_running_loop().run_in_executor(self._thread, self._own, name, scope)
        return response if response is not None else await super().get_response(name, scope)

    def _own(self, name: str, scope: Scope) -> Response | None:
        """A page, or a file by an address with the hash of its content; None for anything else."""
        if scope["path"].endswith("/") or name.endswith(".html"):
            page = self._file(name if name.endswith(".html") else os.path.normpath(f"{name}/index.html"))
            if page is not None:
                return self._page(page.content.decode(), name, scope)
        asked = parse_qs(scope["query_string"].decode("latin-1")).get("v")
        file = self._file(name) if asked else None
        if file is not None and asked == [file.version]:
            return Response(file.content, media_type=guess_type(name)[0], headers={"cache-control": _STAYS})
        return None

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        """A file by an address without the hash of its content, or with that of another version."""
        response = super().file_response(*args, **kwargs)
        response.headers["cache-control"] = "no-cache"
        return response

    def _page(self, text: str, name: str, scope: Scope) -> Response:
        folder = os.path.dirname(name) if name.endswith(".html") else name

        def versioned(found: re.Match[str]) -> str:
            file = self._file(os.path.normpath(os.path.join(folder, found[2])))
            return found[0] if file is None else f'{found[1]}="{found[2]}?v={file.version}"'

        headers, policy = {"cache-control": "no-cache"}, {}
        text = _REFERENCE.sub(versioned, text)
        if _FIRST_MODULE.search(text):
            inline = json.dumps({"imports": dict(self._imports(folder))}, separators=(",", ":"))
            text = _FIRST_MODULE.sub(f'  <script type="importmap">{inline}</script>\n\\g<0>', text, count=1)
            policy["content-security-policy"] = page_policy(b64encode(sha256(inline.encode()).digest()).decode())
        headers["etag"] = f'"{_hash(text.encode())}"'
        response: Response = HTMLResponse(text, headers=headers)
        if self.is_not_modified(response.headers, Headers(scope=scope)):
            response = NotModifiedResponse(response.headers)
        response.headers.update(policy)  # with 304, too: a browser takes its headers for those of the page that it has
        return response

    def _imports(self, folder: str) -> Iterator[tuple[str, str]]:
        """(path, address) of each script, relative to a page in a folder of ``static/``."""
        for path in sorted(self._folder.rglob("*.js")):
            name = path.relative_to(self._folder).as_posix()
            file = self._file(name)
            if file is not None and (name.startswith("js/") or os.path.dirname(name) == folder):
                relative = os.path.relpath(name, folder)
                relative = relative if relative.startswith("../") else f"./{relative}"
                yield relative, f"{relative}?v={file.version}"

    def _file(self, name: str) -> _File | None:
        """A file by its path under the folder, read again if it has changed; None if there is none."""
        path = self._folder / name
        if not path.is_relative_to(self._folder) or ".." in path.parts:
            return None
        try:
            status = path.stat()
            stamp = (status.st_mtime_ns, status.st_size)
            held = self._held.get(name)
            if held is None or held.stamp != stamp:
                content = path.read_bytes()
                held = self._held[name] = _File(stamp, content, _hash(content))
            return held
        except (OSError, ValueError):  # ValueError: a zero byte in the path
            return None


def _hash(content: bytes) -> str:
    return blake2b(content, digest_size=8).hexdigest()


def _file_of(path: str) -> str:
    """Path under ``static/`` for a page's address."""
    first, *rest = Path(path).parts or ("",)
    return os.path.join(_ITS_FOLDER, *rest) if first == _DISPLAY else path
