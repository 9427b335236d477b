"""Names that the page repeats are those of the program."""

from __future__ import annotations

import re
from pathlib import Path

from pipeline.labels.model import NEXT_TAG, WHOLE_TAG

LABELING = Path(__file__).resolve().parents[3] / "static" / "js" / "labeling"


def test_the_page_offers_the_tag_of_frames_whose_vehicles_are_all_labelled() -> None:
    found = re.search(r'const WHOLE_TAG = "([^"]+)"', (LABELING / "acts" / "tags.js").read_text())
    assert found is not None
    assert found[1] == WHOLE_TAG


def test_the_page_offers_the_tag_that_asks_for_labels() -> None:
    found = re.search(r'const NEXT_TAG = "([^"]+)"', (LABELING / "acts" / "tags.js").read_text())
    assert found is not None
    assert found[1] == NEXT_TAG
