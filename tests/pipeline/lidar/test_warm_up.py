"""After warming up, no frame waits for a compiler."""

from __future__ import annotations

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from pipeline.lidar import boxes, cluster, cluster_kernels, ground, ground_kernels, plane_kernels, warm_up
from pipeline.params import Params
from pipeline.types import Sweep
from tests.pipeline.lidar.scenes import scan


def _compiled() -> dict[str, int]:
    """Signatures of all kernels called from Python; those called only by kernels are compiled into them."""
    return {
        f"{module.__name__}.{name}": len(thing.signatures)
        for module in (boxes, cluster, cluster_kernels, ground_kernels, plane_kernels)
        for name, thing in vars(module).items()
        if isinstance(thing, Dispatcher)
    }


@pytest.mark.parametrize("writeable", [True, False])
def test_a_first_sweep_compiles_nothing(writeable: bool) -> None:
    warm_up()
    before = _compiled()
    assert before["pipeline.lidar.ground_kernels.ground"] >= 1
    points = scan([(12.0, -0.9, -1.5, 16.0, 0.9, 0.0)])
    points.flags.writeable = writeable
    points = Sweep(0, points, np.zeros(len(points), np.uint8), 16).points
    params, keep = Params(), np.ones(len(points), np.bool_)
    plane = ground.fit_ground(points, keep, params.ground)
    labels = cluster.cluster(points, cluster.candidates(points, plane, keep, params.cluster), params.cluster)
    assert len(boxes.fit_obstacles(points, labels, plane, params.box)) == 1
    assert _compiled() == before
