"""The drive in the embedded rerun viewer, in a real browser: it opens, and asks nobody but us for anything."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, expect

from app.web.guards.tokens import Tokens
from app.web.server import create_app
from tests.app.web.serving import serving
from tests.browser.conftest import Site
from tests.browser.test_look import SCREENS, WITHOUT_WEBGL

WAIT_MS = 120_000


@pytest.mark.usefixtures("paused_in_traffic")
def test_one_click_opens_this_drive_and_no_request_leaves_the_machine(site: Site, browser: Browser):
    """On a server that requires a token, which the viewer must pass on."""
    tokens = Tokens("person-0123456789abcdef", "display-0123456789abcde")
    context = browser.new_context(viewport={"width": 1100, "height": 720})
    page = context.new_page()
    asked: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    try:
        with serving(create_app(site.engine, tokens=tokens)) as address:
            count = site.engine.snapshot.count
            index = count - 4  # few frames are enough
            site.engine.control.seek(index)
            site.engine.wait_for(lambda shown: shown.index == index, WAIT_MS / 1e3)
            page.goto(f"{address}/?token={tokens.person}")
            expect(page.locator("#transport .name")).to_have_text(f"{index:06d}")
            with page.expect_response(lambda response: "/api/rerun.rrd" in response.url, timeout=WAIT_MS) as replay:
                page.get_by_role("tab", name="rerun").click()
            assert replay.value.ok
            expect(page.locator("#rerun-body .facts")).to_have_text(f"frames {index + 1} to {count} of {count}")
            assert f"first={index}&last={count - 1}&paused=1&compact=1" in replay.value.url
            viewer = page.frame_locator("#rerun-body iframe")
            expect(viewer.locator("html")).to_have_attribute("data-viewer", "started", timeout=WAIT_MS)
            expect(viewer.locator("#said")).to_have_text("")
            expect(viewer.locator("canvas#viewer")).to_be_visible()
            page.screenshot(path=SCREENS / "rerun.png")
            page.goto("about:blank")
    finally:
        context.close()
    hosts = {urlsplit(url).netloc for url in asked if url.startswith("http")}
    assert hosts == {urlsplit(address).netloc}
    assert errors == []


def test_without_webgl_the_viewers_page_says_so(site: Site, browser: Browser):
    context = browser.new_context()
    try:
        page = context.new_page()
        page.add_init_script(f"({WITHOUT_WEBGL})()")
        page.goto(f"{site.address}/rerun/")
        expect(page.locator("#said")).to_have_text("rerun needs WebGL 2, which this browser lacks or has switched off.")
        expect(page.locator("#viewer")).to_be_hidden()
    finally:
        context.close()
