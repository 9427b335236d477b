"""Tables that the page has too are those of the program: sizes of classes, formats of labels."""

from __future__ import annotations

import json
import re
from pathlib import Path

from pipeline.fusion.vehicle_sizes import USUAL_SIZE_M
from pipeline.labels.model import WHOLE_TAG

LABELING = Path(__file__).resolve().parents[3] / "static" / "js" / "labeling"


def test_a_new_cuboid_is_as_large_as_one_that_nobody_measured() -> None:
    found = re.search(r"const TYPICAL_M = (\{.*?\});", (LABELING / "views" / "cuboid.js").read_text(), re.DOTALL)
    assert found is not None
    table = re.sub(r",\s*\}", "}", re.sub(r"(\w+):", r'"\1":', found[1]))
    assert {name: tuple(size) for name, size in json.loads(table).items()} == USUAL_SIZE_M


def test_the_page_offers_the_tag_of_frames_whose_vehicles_are_all_labelled() -> None:
    found = re.search(r'const WHOLE_TAG = "([^"]+)"', (LABELING / "acts" / "tags.js").read_text())
    assert found is not None
    assert found[1] == WHOLE_TAG
