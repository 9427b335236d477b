"""The LiDAR benchmark: what it prints, equal work for its peers, and a sentence where a peer is missing."""

from __future__ import annotations

import numpy as np
import pytest

from app.bench import lidar
from pipeline.lidar.cluster import cluster
from pipeline.params import Params
from pipeline.types import Sweep
from tests.pipeline.lidar.scenes import scan


@pytest.fixture(scope="module")
def sweep() -> Sweep:
    points = scan([(12.0, -0.9, -1.5, 16.0, 0.9, 0.0), (5.0, 3.0, -1.5, 9.0, 5.0, 0.5)])
    return Sweep(0, points, np.zeros(len(points), np.uint8), 16)


def test_every_stage_has_its_figures(sweep: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lidar, "_open3d", lambda: (None, "no libX11 here"))
    figures = lidar.stages([sweep], 0.3, Params())
    assert list(figures) == ["ground", "cluster", "lidar_chain"]
    for row in figures.values():
        assert 0.0 < row["median_ms"] <= row["p99_ms"]
    numpy_peer = figures["ground"]["peers"]["numpy"]
    assert numpy_peer["ratio"] == pytest.approx(numpy_peer["median_ms"] / figures["ground"]["median_ms"])
    assert figures["cluster"]["peers"]["open3d cluster_dbscan"]["absent"] == "no libX11 here"
    assert figures["lidar_chain"]["peers"]["open3d"]["median_ms"] is None


def test_no_sweeps_no_figures() -> None:
    assert lidar.stages([], 1.0, Params()) == {}


def test_a_missing_library_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "open3d", None)
    module, reason = lidar._open3d()
    assert module is None
    assert "libusb-1.0-0" in reason


def test_the_peer_does_the_same_work(sweep: Sweep) -> None:
    """Open3D's clustering gives our partition, and its chain finds the two blocks."""
    open3d, reason = lidar._open3d()
    if open3d is None:
        pytest.skip(reason)
    params = Params()
    prepared = lidar._prepare(sweep, params)
    peer = lidar.Open3dPeer(open3d, params)
    ours = cluster(sweep.points, prepared.chosen, params.cluster.model_copy(update={"min_points": 1}))[prepared.chosen]
    theirs = peer.cluster(prepared)
    assert len(set(zip(ours.tolist(), theirs.tolist(), strict=True))) == len(set(ours.tolist())) == theirs.max() + 1
    assert len(peer.chain(prepared, None)) >= 2
    assert len(lidar.obstacles_of(sweep, params)) == 2
