"""The benchmark's own connection to a browser."""

from __future__ import annotations

import pytest

from app.bench.page.devtools import CHROMIUM, browser
from pipeline.common.errors import BadInput

pytestmark = pytest.mark.skipif(not CHROMIUM.exists(), reason=f"no {CHROMIUM}")


def test_scripts_run_in_a_page_with_nothing_kept():
    with browser() as running:
        page = running.open("data:text/html,<title>one page</title>", "window.early = document.title")
        assert page.call("() => [window.early, document.title, window.innerWidth]") == ["", "one page", 1440]
        assert page.call("async (a, b) => ({ sum: a + (await b) })", 1, 2) == {"sum": 3}
        with pytest.raises(BadInput, match="not this"):
            page.call("(what) => { throw new Error(what); }", "not this")
        page.close()
        with pytest.raises(BadInput, match="refuses"):
            page.call("() => 1")
        assert running.cpu_s()["browser"] > 0
