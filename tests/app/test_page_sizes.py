"""The page draws a new cuboid as large as the line takes an unmeasured one to be."""

from __future__ import annotations

import json
import re
from pathlib import Path

from pipeline.sizes import USUAL_SIZE_M

CUBOID = Path(__file__).resolve().parents[2] / "static" / "js" / "labeling" / "cuboid.js"


def test_the_page_has_the_same_sizes() -> None:
    found = re.search(r"const TYPICAL_M = (\{.*?\});", CUBOID.read_text(), re.DOTALL)
    assert found is not None
    table = re.sub(r",\s*\}", "}", re.sub(r"(\w+):", r'"\1":', found[1]))
    assert {name: tuple(size) for name, size in json.loads(table).items()} == USUAL_SIZE_M
