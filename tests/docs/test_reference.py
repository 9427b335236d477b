"""Generated pages are up to date, and handwritten ones agree with the code."""

from __future__ import annotations

import re

import pytest

from pipeline.decision.gates import CONDITIONS
from pipeline.labels.formats.registry import FORMATS
from tests.docs.pages import DOCS, code_spans
from tests.docs.reference_pages import PAGES
from tests.pipeline.types.test_result_json import FIELDS

RESULTS = "docs/reference/results.md"


@pytest.mark.parametrize("name", PAGES)
def test_a_made_page_is_up_to_date(name: str) -> None:
    text = (DOCS / name).read_text(encoding="utf-8")
    assert text == PAGES[name](), "run `make docs`"


@pytest.mark.parametrize("path", FIELDS)
def test_the_results_page_has_every_field(path: str) -> None:
    said = {word for span in code_spans(RESULTS) for word in re.split(r"[^\w]+", span)}
    assert set(FIELDS[path].split()) <= said


def test_every_condition_of_a_lead_is_explained_in_its_order() -> None:
    names = [condition.shown_as for condition in CONDITIONS]
    table = (DOCS / "reference/results.md").read_text(encoding="utf-8").partition("### gates")[2].partition("\n## ")[0]
    assert [name for name in re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE) if name in names] == names
    assert set(names) <= set(code_spans("docs/guides/why.md"))


def test_no_option_shows_pythons_none() -> None:
    assert "None" not in (DOCS / "reference/cli.md").read_text(encoding="utf-8")


def test_every_label_format_is_in_the_guide() -> None:
    assert set(FORMATS) <= set(code_spans("docs/guides/label.md"))
