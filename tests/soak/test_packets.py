"""100,000 VLP-16 packets, a tenth of them spoiled: no crash, no lost sweep."""

from __future__ import annotations

import json

import pytest

from tests.conftest import ROOT
from tests.pipeline.formats.velodyne.damage import survives


@pytest.mark.soak
@pytest.mark.timeout(600)
@pytest.mark.parametrize("share", [0.02, 0.1, 1.0])
def test_100_000_packets(share: float) -> None:
    report = survives(packets=100_000, share=share, seed=7)
    assert report.packets >= 100_000
    (ROOT / "build").mkdir(exist_ok=True)
    path = ROOT / "build" / f"packets_{share}.json"
    path.write_text(json.dumps(report._asdict(), indent=1) + "\n", encoding="utf-8")
    print(report)
