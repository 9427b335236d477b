"""XML from users: only plain elements are read."""

from __future__ import annotations

import pytest

from pipeline.common.errors import BadInput
from pipeline.formats.xml_text import parse_xml


def test_the_root_is_read_whatever_encoding_the_text_names() -> None:
    assert parse_xml('\ufeff\n<?xml version="1.0" encoding="no-such-code"?><gpx/>', "a.gpx").tag == "gpx"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<gpx>", "a.gpx: not XML: "),
        ("", "a.gpx: not XML: "),
        ('<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "a.gpx: XML with a document type"),
        ("<!-- " + 20_000 * "x" + " --><!DOCTYPE x><gpx/>", "a.gpx: XML with a document type"),
    ],
)
def test_anything_else_is_refused(text: str, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        parse_xml(text, "a.gpx")
