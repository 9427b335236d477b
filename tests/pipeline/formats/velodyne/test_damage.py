"""Streams with spoiled packets: no crash, no lost sweep. A slice; the long run is in tests/soak."""

from __future__ import annotations

import pytest

from tests.pipeline.formats.velodyne.damage import survives


@pytest.mark.parametrize("share", [0.02, 0.2])
def test_spoiled_packets_cost_no_sweep(share: float) -> None:
    survives(packets=3_000, share=share, seed=1)
