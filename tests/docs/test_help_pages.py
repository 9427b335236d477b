"""The documentation as the program serves it."""

from __future__ import annotations

import re
from collections.abc import Iterator

import httpx
import pytest

from app.engine.engine import Engine
from app.web import help_pages
from app.web.guards.tokens import Tokens
from app.web.server import create_app
from pipeline.params import Params
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.web.serving import WAIT_S, serving

PAGES = sorted(file for file in help_pages.files() if file.endswith(".md"))
IMAGES = sorted(file for file in help_pages.files() if not file.endswith(".md"))
TOKENS = Tokens("person-0123456789abcdef", "display-0123456789abcde")


@pytest.fixture(scope="module")
def engine() -> Engine:
    """Not started: help needs no recording."""
    recording = Recording()
    return Engine(opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri)


@pytest.fixture(scope="module")
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


@pytest.mark.parametrize("file", PAGES)
def test_every_page_answers_with_its_title(client: httpx.Client, file: str) -> None:
    title = help_pages.render(help_pages.files()[file].read_text(encoding="utf-8"), file).title
    answer = client.get(f"/help/{help_pages.address_of(file)}")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/html")
    assert re.search(r"<h1[^>]*>(.*?)</h1>", answer.text, re.DOTALL)
    assert f"<title>{title}" in answer.text
    assert 'aria-current="page"' in answer.text


@pytest.mark.parametrize("file", PAGES)
def test_every_link_of_a_page_is_served(client: httpx.Client, file: str) -> None:
    body = client.get(f"/help/{help_pages.address_of(file)}").text
    served = {f"/help/{help_pages.address_of(page)}" for page in PAGES}
    linked = {match.partition("#")[0] for match in re.findall(r'href="(/help/[^"]*)"', body)}
    assert linked <= served
    assert "../" not in "".join(re.findall(r'href="([^"]*)"', body)), "a link that leaves docs/ is no link here"


def test_no_line_breaks_between_a_number_and_its_unit() -> None:
    text = "At 13 m/s, 62 % within 0.3 s and 40 km/h; 3 sensors, 5 main roads. `--at 20 m`"
    body = help_pages.render(text, "a.md").body.replace("\u00a0", "~")
    assert "At 13~m/s, 62~% within 0.3~s and 40~km/h; 3 sensors, 5 main roads. <code>--at 20 m</code>" in body


def test_a_page_is_found_by_its_file_name_too(client: httpx.Client) -> None:
    assert client.get("/help/guides/why.md").text == client.get("/help/guides/why").text


@pytest.mark.parametrize("file", IMAGES)
def test_images_are_served(client: httpx.Client, file: str) -> None:
    answer = client.get(f"/help/{file}")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("image/")


def test_what_a_page_needs_is_served(client: httpx.Client) -> None:
    for needed in re.findall(r'(?:src|href)="(/[^"#]*\.(?:css|js|svg))"', client.get("/help/").text):
        assert client.get(needed).status_code == 200, needed


def test_without_the_last_slash_it_leads_on(client: httpx.Client) -> None:
    answer = client.get("/help")
    assert answer.status_code in (307, 308)
    assert answer.headers["location"].endswith("/help/")


def test_a_missing_page_is_said_as_a_page(client: httpx.Client) -> None:
    answer = client.get("/help/guides/<nothing>")
    assert answer.status_code == 404
    assert "<h1>Page not found</h1>" in answer.text
    assert "guides/&lt;nothing&gt;" in answer.text
    assert "/help/getting-started" in answer.text


@pytest.mark.parametrize(
    "path", ["../pyproject.toml", "..%2fpyproject.toml", "%2e%2e/%2e%2e/etc/passwd", "/etc/passwd"]
)
def test_no_other_file_is_served(client: httpx.Client, path: str) -> None:
    assert client.get(f"/help/{path}").status_code == 404


def test_the_security_headers_are_those_of_the_other_pages(client: httpx.Client) -> None:
    """Only the hash of the import map, which help does not have, is the dashboard's own."""
    help_pages, dashboard = (client.get(path).headers["content-security-policy"] for path in ("/help/", "/"))
    assert help_pages == re.sub(r" 'sha256-[^']+'", "", dashboard)


def test_help_needs_a_token_where_everything_does(engine: Engine) -> None:
    with serving(create_app(engine, hosts=["0.0.0.0"], tokens=TOKENS)) as address:
        assert httpx.get(f"{address}/help/", timeout=WAIT_S).status_code == 401
        cookie = {"authorization": f"Bearer {TOKENS.display}"}
        assert httpx.get(f"{address}/help/", headers=cookie, timeout=WAIT_S).status_code == 200
