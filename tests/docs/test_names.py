"""Two things never share a name: no two public classes, nor a class and a type alias, of pipeline and app."""

from __future__ import annotations

import ast
import re
from collections import defaultdict

import pytest

from tests.docs.pages import ROOT

SHARED = {
    "Given": "in the schemas of recorded files and in the API, which keep their names",
    "Moment": "of a pipeline's step, and of a labelled drive",
    "State": "of a pipeline's step, and each a word of the results or of labels: acc.state, label state",
    "Seen": "an object in a frame, for proposals of labels, and a frame in the match of edges",
    "Database": "the labels' database, and the option that names it",
    "Person": "who labels, and the option that names them",
}
"""Names that are still shared, with their meanings."""
A_TYPE = re.compile(r"[A-Z][a-z]\w*")
A_PICTURE = re.compile("picture", re.IGNORECASE)


def named() -> dict[str, list[str]]:
    found: dict[str, list[str]] = defaultdict(list)
    for root in ("pipeline", "app"):
        for file in (ROOT / root).rglob("*.py"):
            for node in ast.parse(file.read_text(encoding="utf-8")).body:
                name = _name_of(node)
                if name is not None:
                    found[name].append(f"{file.relative_to(ROOT)}:{node.lineno}")
    return found


def _name_of(node: ast.stmt) -> str | None:
    if isinstance(node, ast.ClassDef):
        return None if node.name.startswith("_") else node.name
    if not isinstance(node, ast.Assign) or len(node.targets) != 1 or not isinstance(node.targets[0], ast.Name):
        return None
    is_variable = isinstance(node.value, ast.Call) and ast.unparse(node.value.func).endswith("TypeVar")
    return node.targets[0].id if A_TYPE.fullmatch(node.targets[0].id) and not is_variable else None


def test_no_two_types_share_a_name() -> None:
    found = named()
    assert len(found) > 600
    assert {name: where for name, where in found.items() if len(where) > 1 and name not in SHARED} == {}


def test_no_exception_is_kept_longer_than_needed() -> None:
    found = named()
    assert {name for name in SHARED if len(found[name]) < 2} == set()


SAY_PICTURE = {
    "pipeline/recording/session/frame_record.py": "a field of recorded frames",
    "pipeline/recording/session/source.py": "the same field",
    "pipeline/recording/session/writer.py": "the same field",
    "pipeline/sources/live/source.py": "a stage of timing_ms",
    "pipeline/training/dataset.py": "a column of training data",
    "pipeline/source_kinds.py": "the source pictures:",
    "pipeline/sources/camera_alone.py": "the source pictures:",
    "pipeline/simulation/sensors/faults.py": "a field of scenarios, pictures_lost",
    "pipeline/simulation/sensors/senses.py": "the same field",
    "pipeline/experiments/robustness/traffic.py": "the same field",
    "app/streaming/encode.py": "a field of the stream",
    "app/streaming/stream.py": "a message of the page, picture_px",
    "static/js/core/protocol.js": "a field of the stream",
    "static/js/core/connection.js": "a message of the page, picture_px",
}
"""Places where a camera image is still called a picture: names that are stored or sent cannot change."""


@pytest.mark.parametrize("suffix", ["py", "js"])
def test_a_cameras_image_is_called_an_image(suffix: str) -> None:
    files = [file for root in ("pipeline", "app", "static") for file in (ROOT / root).rglob(f"*.{suffix}")]
    assert len(files) > 100
    found = {
        str(file.relative_to(ROOT))
        for file in files
        if A_PICTURE.search(f"{file.name} {file.read_text(encoding='utf-8')}")
    }
    assert found == {file for file in SAY_PICTURE if file.endswith(f".{suffix}")}
