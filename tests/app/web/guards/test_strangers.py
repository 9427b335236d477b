"""Other websites, rebound host names, and paths outside the page: all refused."""

from __future__ import annotations

import http.client
from collections.abc import Callable
from urllib.parse import urlsplit

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection

from tests.app.web.asking import WAIT_S


@pytest.mark.parametrize("path", ["/api/playback", "/api/source", "/api/params/preset"])
def test_a_foreign_page_changes_nothing(client: httpx.Client, path: str):
    answer = client.post(path, json={}, headers={"origin": "http://evil.example"})
    assert answer.status_code == 403


def test_a_foreign_page_has_nothing_computed(client: httpx.Client):
    for path in ("/api/result", "/api/drive/events"):
        assert client.get(path, headers={"sec-fetch-site": "cross-site"}).status_code == 403
        assert client.get(path, headers={"sec-fetch-site": "same-origin"}).status_code == 200


def test_a_rebound_name_reads_nothing(client: httpx.Client):
    assert client.get("/api/state", headers={"host": "evil.example"}).status_code == 403
    assert client.get("/", headers={"host": "evil.example"}).status_code == 403


def test_a_foreign_page_gets_no_stream(stream: Callable[..., ClientConnection]):
    with pytest.raises(InvalidStatus, match="403"):
        stream(origin="http://evil.example")


def test_a_rebound_name_gets_no_stream(client: httpx.Client):
    upgrade = {
        "host": "evil.example",
        "origin": "http://evil.example",
        "connection": "Upgrade",
        "upgrade": "websocket",
        "sec-websocket-version": "13",
        "sec-websocket-key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    assert client.get("/api/stream", headers=upgrade).status_code == 403


OUTSIDE = [
    "/../app/server.py",
    "/%2e%2e/pyproject.toml",
    "/js/..%2f..%2fpyproject.toml",
    "/..%5cREADME.md",
    "//etc/passwd",
]


@pytest.mark.parametrize("path", OUTSIDE)
def test_files_outside_the_page_are_not_served(address: str, path: str):
    connection = http.client.HTTPConnection(urlsplit(address).netloc, timeout=WAIT_S)
    connection.request("GET", path)
    assert connection.getresponse().status == 404
    connection.close()


@pytest.mark.parametrize("path", ["/", "/js/main.js", "/palette.css", "/api/state"])
def test_security_headers(client: httpx.Client, path: str):
    answer = client.get(path)
    assert answer.status_code == 200
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
