"""The drive in the embedded rerun viewer, in a real browser: it opens, and asks nobody but us for anything."""

from __future__ import annotations

from urllib.parse import urlsplit

import httpx
import pytest
from playwright.sync_api import Browser

from tests.browser.conftest import Site

WAIT_MS = 120_000


@pytest.mark.usefixtures("paused_in_traffic")
def test_one_click_opens_this_drive_and_no_request_leaves_the_machine(site: Site, browser: Browser):
    answer = httpx.get(f"{site.address}/api/rerun/open", timeout=60)
    assert answer.status_code == 200
    address = answer.json()
    assert address["first"] == site.engine.snapshot.index
    context = browser.new_context(viewport={"width": 900, "height": 600})
    page = context.new_page()
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        # three frames are enough to see that the replay is taken over
        short = f"/rerun/?first={address['first']}&last={address['first'] + 2}&paused=1"
        with page.expect_response(lambda response: "/api/rerun.rrd" in response.url, timeout=WAIT_MS) as replay:
            page.goto(site.address + short)
        assert replay.value.ok
        page.wait_for_function("document.documentElement.dataset.viewer === 'started'", timeout=WAIT_MS)
        assert page.locator("#said").text_content() == ""
        assert page.locator("canvas#viewer").is_visible()
    finally:
        context.close()
    hosts = {urlsplit(url).netloc for url in asked if url.startswith("http")}
    assert hosts == {urlsplit(site.address).netloc}
    assert errors == []
