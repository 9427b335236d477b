"""A page's files are asked for once: their addresses change with their content."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
import re
from base64 import b64encode
from pathlib import Path
from urllib.parse import urljoin, urlsplit

import httpx
import pytest

from app.web.page_files import STATIC, PageFiles

PAGES = {"/": "", "/drive/": "incar"}


def import_map(page: str) -> dict[str, str]:
    (inline,) = re.findall(r'<script type="importmap">(.*?)</script>', page)
    return json.loads(inline)["imports"]


def at(page: str, name: str) -> Path:
    """The file that a page calls by this name."""
    path = urlsplit(urljoin(page, name)).path
    return STATIC / re.sub("^/drive/", "/incar/", path).lstrip("/")


@pytest.mark.parametrize("path", PAGES)
def test_each_script_and_style_of_a_page_has_the_hash_of_its_content_in_its_address(client: httpx.Client, path: str):
    page = client.get(path)
    mapped = import_map(page.text)
    scripts = {*(STATIC / "js").rglob("*.js"), *(STATIC / (PAGES[path] or "js")).glob("*.js")}
    assert {at(path, each) for each in mapped} == scripts
    named = re.findall(r'(?:href|src)="([^"]+\.(?:css|js|svg)\?v=[^"]+)"', page.text)
    assert {urlsplit(each).path.rpartition(".")[2] for each in named} == {"css", "js", "svg"}
    for each in (*mapped.values(), *named):
        file = client.get(urljoin(path, each))
        assert file.headers["cache-control"] == "max-age=31536000, immutable"
        assert file.content == at(path, each).read_bytes()
        assert file.headers["content-type"].partition(";")[0] in {"text/javascript", "text/css", "image/svg+xml"}


@pytest.mark.parametrize("path", PAGES)
def test_only_the_import_map_may_run_inline(client: httpx.Client, path: str):
    page = client.get(path)
    (inline,) = re.findall(r'<script type="importmap">(.*?)</script>', page.text)
    expected = b64encode(hashlib.sha256(inline.encode()).digest()).decode()
    assert f"script-src 'self' 'sha256-{expected}';" in page.headers["content-security-policy"]
    assert page.text.index(inline) < page.text.index('<script type="module"'), "else browsers ignore it"
    assert "sha256" not in client.get("/js/main.js").headers["content-security-policy"]


@pytest.mark.parametrize("path", [*PAGES, "/index.html"])
def test_the_page_itself_is_asked_for_each_time(client: httpx.Client, path: str):
    page = client.get(path)
    assert page.headers["cache-control"] == "no-cache"
    again = client.get(path, headers={"if-none-match": page.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    for header in ("content-security-policy", "cache-control", "etag"):
        assert again.headers[header] == page.headers[header]


@pytest.mark.parametrize("path", ["/js/main.js", "/js/main.js?v=0123456789abcdef", "/js/main.js?v="])
def test_an_address_without_the_current_hash_gives_the_current_file_for_now(client: httpx.Client, path: str):
    file = client.get(path)
    assert file.headers["cache-control"] == "no-cache"
    assert file.content == (STATIC / "js" / "main.js").read_bytes()


@pytest.mark.parametrize("path", ["/%2e%2e/pyproject.toml?v=1", "/nothing.js?v=1", "/a%00b.js?v=1", "/nothing/"])
def test_what_is_no_file_of_the_page_is_not_found(client: httpx.Client, path: str):
    assert client.get(path).status_code == 404


def get(files: PageFiles, address: str, headers: dict[str, str] | None = None) -> httpx.Response:
    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=httpx.ASGITransport(files), base_url="http://127.0.0.1") as client:
            return await client.get(address, headers=headers)

    return asyncio.run(ask())


def test_a_changed_file_has_another_address_and_the_others_keep_theirs(tmp_path: Path):
    (tmp_path / "js").mkdir()
    (tmp_path / "index.html").write_text('  <script type="module" src="js/main.js"></script>\n', encoding="utf-8")
    for name in ("main", "other"):
        (tmp_path / "js" / f"{name}.js").write_text(f"export const {name} = 1;\n", encoding="utf-8")
    asked: list[None] = []
    files = PageFiles(lambda: asked.append(None), tmp_path)
    page = get(files, "/")
    before = import_map(page.text)
    (tmp_path / "js" / "other.js").write_text("export const other = 2;\n", encoding="utf-8")
    os.utime(tmp_path / "js" / "other.js", ns=(0, 0))  # as coarse as a file system's clock may be, it is another time
    changed = get(files, "/", {"if-none-match": page.headers["etag"]})
    assert changed.status_code == 200
    after = import_map(changed.text)
    assert after["./js/main.js"] == before["./js/main.js"]
    assert after["./js/other.js"] != before["./js/other.js"]
    old = get(files, before["./js/other.js"].removeprefix("."))
    assert old.text == "export const other = 2;\n"
    assert old.headers["cache-control"] == "no-cache"
    assert len(asked) == 3, "a user waits for each"
