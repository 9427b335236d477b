"""No broken link, anchor or image in the documentation."""

from __future__ import annotations

import importlib
import re
from urllib.parse import urlsplit

import pytest

from app.web import help_pages
from tests.docs.pages import DOCS, FILES, ROOT, code_spans, links

MOST_README_LINES = 150
LARGEST_IMAGE_BYTES = 300_000
PACKAGES = ("app", "pipeline", "static", "tests")
IN_THIS_REPOSITORY = re.compile(r"(app|pipeline|static|tests|docs|\.ci)/[\w./-]*|(app|pipeline)(\.[a-z_0-9]+)+")
A_FILE = re.compile(r"[\w-]+\.(py|js|html|css|svg|toml|lock|ini)")
TO_BE_WRITTEN = {"pipeline/ranging/radar.py", "pipeline/simulation/sensors/radar.py"}
"""Files that a guide tells its reader to create."""
CITED_CODE = re.compile(r"(?<![\w/.-])(?:app|pipeline|static|tests)/[\w/-]+(?:\.(?:py|js|css|html))?(?![\w-])")
CITED_PAGE = re.compile(r"(?<![\w/])docs/[\w/-]+\.md\b")


def anchors(file: str) -> set[str]:
    page = help_pages.render((ROOT / file).read_text(encoding="utf-8"), file)
    return {heading.anchor for heading in page.headings}


@pytest.mark.parametrize("file", FILES)
def test_every_link_leads_somewhere(file: str) -> None:
    broken = []
    for target, is_image in links(file):
        parts = urlsplit(target)
        if parts.scheme:
            if parts.scheme not in ("http", "https") or not parts.netloc or is_image:
                broken.append(target)
            continue
        path = ((ROOT / file).parent / parts.path).resolve() if parts.path else ROOT / file
        if (
            not path.exists()
            or not path.is_relative_to(ROOT)
            or (parts.fragment and parts.fragment not in anchors(path.relative_to(ROOT).as_posix()))
        ):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("file", FILES)
def test_every_file_and_module_it_names_exists(file: str) -> None:
    named = {span.rstrip("/") for span in code_spans(file) if IN_THIS_REPOSITORY.fullmatch(span)}
    paths = {name.replace(".", "/") if "/" not in name else name for name in named} - TO_BE_WRITTEN
    assert sorted(path for path in paths if not ((ROOT / path).exists() or (ROOT / f"{path}.py").exists())) == []


@pytest.mark.parametrize("file", FILES)
def test_every_file_that_it_names_without_a_folder_exists(file: str) -> None:
    named = {span for span in code_spans(file) if A_FILE.fullmatch(span)}
    present = {path.name for package in PACKAGES for path in (ROOT / package).rglob("*")}
    present |= {path.name for path in ROOT.iterdir()}
    assert sorted(named - present) == []


def test_every_page_that_code_cites_exists() -> None:
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.suffix in (".py", ".js")]
    cited = {page for path in sources for page in CITED_PAGE.findall(path.read_text(encoding="utf-8"))}
    assert "docs/reference/results.md" in cited
    assert sorted(page for page in cited if not (ROOT / page).exists()) == []


def test_every_file_that_code_cites_exists() -> None:
    sources = [
        path for package in PACKAGES[:3] for path in (ROOT / package).rglob("*") if path.suffix in (".py", ".js")
    ]
    cited = {
        (name, path.relative_to(ROOT).as_posix())
        for path in sources
        for name in CITED_CODE.findall(path.read_text(encoding="utf-8"))
    }
    assert ("app/engine/player.py", "app/engine/engine.py") in cited
    missing = {(name, path) for name, path in cited if not ((ROOT / name).exists() or (ROOT / f"{name}.py").exists())}
    assert missing == set()


def test_the_index_lists_every_page_once() -> None:
    groups = help_pages.navigation((DOCS / help_pages.INDEX).read_text(encoding="utf-8"))
    listed = [target for group in groups for target, _ in group.links]
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")} - {help_pages.INDEX}
    assert sorted(listed) == sorted(pages)


@pytest.mark.parametrize("file", [file for file in FILES if file.startswith("docs/")])
def test_a_page_has_one_title(file: str) -> None:
    page = help_pages.render((ROOT / file).read_text(encoding="utf-8"), file)
    assert [heading.level for heading in page.headings].count(1) == 1


def test_every_image_is_small_and_used() -> None:
    used = {
        (ROOT / file).parent.joinpath(link.target).resolve() for file in FILES for link in links(file) if link.is_image
    }
    images = set((DOCS / "img").iterdir())
    assert {image.name for image in images if image.stat().st_size > LARGEST_IMAGE_BYTES} == set()
    assert {image.name for image in images - used} == set()


def test_every_screenshot_is_made_by_the_script() -> None:
    pytest.importorskip("playwright")
    importlib.import_module("tests.docs.screenshots")
    script = (ROOT / "tests" / "docs" / "screenshots.py").read_text(encoding="utf-8")
    made = set(re.findall(r'save\(.*, "([\w-]+)"\)', script))
    assert made == {image.stem for image in (DOCS / "img").glob("*.jpg")}


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= MOST_README_LINES
