"""Requests to servers on this machine, whatever proxy the environment names for others: `http_proxy` without `no_proxy`
would send them, too, to a proxy, which knows no such address."""

from __future__ import annotations

import urllib.request
from typing import IO, cast

_OPENER = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def open_local(request: str | urllib.request.Request, timeout_s: float | None = None) -> IO[bytes]:
    """The open response of a server on this machine. OSError if there is none, HTTPError if it refuses."""
    return cast("IO[bytes]", _OPENER.open(request, timeout=timeout_s))
