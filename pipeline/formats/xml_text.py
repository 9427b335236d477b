"""Reads XML files that a user named, without the dangerous parts of XML: document types and entities."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

from pipeline.common.errors import BadInput


def parse_xml(text: str, what: str, refuse: Callable[[str], BadInput] = BadInput) -> ElementTree.Element:
    """The root element. Else what ``refuse`` makes of a sentence that begins with ``what`` is raised. The encoding that
    the text names is ignored: it has been decoded."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise refuse(f"{what}: XML with a document type or entities is not accepted")
    try:
        return ElementTree.fromstring(text.lstrip("\ufeff \r\n\t"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise refuse(f"{what}: not XML: {error}") from None
