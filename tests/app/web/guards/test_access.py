"""Which requests are accepted: names of this machine, pages of the same origin, and programs."""

from __future__ import annotations

import pytest
from starlette.datastructures import Headers

from app.web.guards.access import Access

CASES = {
    "the page itself": ("127.0.0.1:8420", "http://127.0.0.1:8420", True, True),
    "localhost": ("localhost:8420", "http://localhost:8420", True, True),
    "IPv6 loopback": ("[::1]:8420", "http://[::1]:8420", True, True),
    "a program, without an origin": ("127.0.0.1:8420", None, True, True),
    "a foreign page reading": ("127.0.0.1:8420", "http://evil.example", False, True),
    "a foreign page changing": ("127.0.0.1:8420", "http://evil.example", True, False),
    "another port of this machine": ("127.0.0.1:8420", "http://127.0.0.1:9999", True, False),
    "a sandboxed page": ("127.0.0.1:8420", "null", True, False),
    "a rebound name": ("evil.example:8420", "http://evil.example:8420", False, False),
    "a name that begins like ours": ("localhost.evil.example", None, False, False),
    "no host": ("", None, False, False),
    "a malformed host": ("[::1", None, False, False),
    "a configured name": ("car.local:8420", "http://car.local:8420", True, True),
}


FETCHES = {
    "our own page": ("/api/export", "same-origin", True),
    "an address that a person typed": ("/api/export", "none", True),
    "a program": ("/api/export", None, True),
    "a foreign page": ("/api/export", "cross-site", False),
    "a page of another port": ("/api/export", "same-site", False),
    "a foreign page's link to the dashboard": ("/", "cross-site", True),
    "a foreign page's link to the display": ("/drive/", "cross-site", True),
}


@pytest.mark.parametrize("name", FETCHES)
def test_the_api_works_for_no_other_page(name: str):
    path, site, welcome = FETCHES[name]
    headers = Headers({"host": "127.0.0.1:8420"} | ({"sec-fetch-site": site} if site is not None else {}))
    assert (Access().refusal(headers, changes=False, path=path) is None) == welcome


@pytest.mark.parametrize("name", CASES)
def test_access(name: str):
    host, origin, changes, welcome = CASES[name]
    headers = Headers({"host": host} | ({"origin": origin} if origin is not None else {}))
    refusal = Access(["car.local"]).refusal(headers, changes=changes)
    assert (refusal is None) == welcome
