"""The parts of the page benchmark that need no browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.bench.page import devtools
from app.bench.page.labelled import many
from app.bench.page.measure import _revision_of, _spread, figures
from pipeline.common.errors import BadInput
from pipeline.labels.model import LabelSet
from pipeline.labels.validate import check


def test_without_a_browser_it_says_what_it_needs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(devtools, "CHROMIUM", tmp_path / "no-browser")
    with pytest.raises(BadInput, match="needs a browser at"):
        figures("sim:straight", 0.1)


@pytest.mark.parametrize(
    ("message", "revision"),
    [(b'\x10{"state":{"params_revision":17,"x":1}', 17), (b"no json at all", -1), (b"", -1)],
)
def test_the_revision_of_a_message(message: bytes, revision: int):
    assert _revision_of(message) == revision


def test_figures_of_nothing_are_unknown():
    assert _spread([]) == {"median_ms": None, "p95_ms": None}
    assert _spread([10.0, 20.0, 30.0])["median_ms"] == 20.0


@pytest.mark.parametrize("frames", [7, 200])
def test_made_up_labels_are_as_many_as_wanted_and_whole(frames: int):
    names, t_ns = tuple(f"{n:06d}" for n in range(frames)), tuple(range(0, frames * 10**8, 10**8))
    made = check(many(LabelSet("test:bench", names, t_ns, ()), 1400), "made up")
    assert sum(len(track.sightings) for track in made.tracks) == 1400
    assert [each.first for each in made.leads] == list(range(0, frames, 10))
