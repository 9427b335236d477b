"""How often the window of the far view contains the lead, on simulated roads that bend.

    python -m tests.soak.far_window

The window follows the curve that ego motion implies, not the tracked lead. The camera of the simulator is given the
image of Astyx, whose field of view is the narrowest of the recordings here, and of KITTI, the widest. A lead 40 to
100 m ahead counts unless it is hidden. It is contained if its box keeps clear of the inner edges of the window, as a
box must in order to be used.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.common.fast_replace import evolve
from pipeline.common.files.data_dir import data_dir
from pipeline.experiments.curves.drives import CurveFrame, moments, seen
from pipeline.experiments.curves.scenarios import LAYOUTS
from pipeline.experiments.curves.scenarios import scenario as bends
from pipeline.experiments.robustness.traffic import scenario as traffic
from pipeline.simulation.scenario import Scenario
from pipeline.sources import open_source
from pipeline.types import CameraCalibration
from pipeline.vision.far_view import is_whole, window_of

FROM_M, TO_M = 40.0, 100.0
DRIVES, TRAFFIC_DRIVES, TRAFFIC_SEED = 2, 12, 20202
CAMERAS = {"Astyx": "astyx:astyx", "KITTI": "kitti:kitti_0052"}


def scenes() -> Iterator[tuple[str, Scenario]]:
    """Drives on each road of the experiment ``curves``, then on random roads."""
    for layout in LAYOUTS.values():
        for seed in range(DRIVES):
            yield layout.title, bends(replace(layout, reach_m=TO_M), seed)
    for number in range(TRAFFIC_DRIVES):
        yield "random traffic", traffic(TRAFFIC_SEED, number)


def contains(moment: CurveFrame, lens: CameraCalibration, size: tuple[int, int]) -> bool:
    """Whether the window contains the lead's box. lens, size: intrinsics and (width, height) of the image."""
    assert moment.lead is not None
    assert moment.frame.camera is not None
    camera = replace(moment.frame.camera, K=lens.K)
    corners = moment.lead.cuboid.corners() @ camera.T_camera_ego[:3, :3].T + camera.T_camera_ego[:3, 3]
    pixels = corners @ camera.K.T
    pixels = pixels[:, :2] / pixels[:, 2:]
    box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]).astype(np.float32)[None]
    return bool(is_whole(box, window_of(evolve(moment.frame, camera=camera), size), size).all())


def main() -> None:
    lenses = {}
    for name, spec in CAMERAS.items():
        kind, _, folder = spec.partition(":")
        frame = open_source(f"{kind}:{data_dir() / folder}").frame(0)
        assert frame.camera is not None
        assert frame.image is not None
        height, width = frame.image.bgr.shape[:2]
        lenses[name] = (frame.camera, (width, height))
    leads: Counter[str] = Counter()
    contained: Counter[tuple[str, str]] = Counter()
    for road, scene in scenes():
        for moment in moments(scene, seen(scene), TO_M):
            if moment.lead_m is None or moment.lead_m < FROM_M:
                continue
            leads[road] += 1
            for name, (lens, size) in lenses.items():
                contained[road, name] += contains(moment, lens, size)
    print("| road | leads |", " | ".join(f"in the window, {name}" for name in lenses), "|")
    for road, count in leads.items():
        print(f"| {road} | {count} |", " | ".join(str(contained[road, name]) for name in lenses), "|")


if __name__ == "__main__":
    main()
