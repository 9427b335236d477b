"""The server whose clients the tests are."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.app.streaming.stream_site import Site, serving


@pytest.fixture
def site() -> Iterator[Site]:
    with serving() as found:
        yield found
