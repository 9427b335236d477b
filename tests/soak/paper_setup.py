"""Lateral error of vehicles seen by the camera alone at 45 m in the paper's three layouts, by alignment.

    python -m tests.soak.paper_setup --runs 10

Bumper LiDAR, windscreen camera, 78° lens with distortion. ``fitted`` is the angular model nearest to the calibration
over the road ahead. The paper prints 1.59 m.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import numpy as np

from pipeline.alignment.convert import angular_of
from pipeline.alignment.projection import Pinhole
from pipeline.experiments.paper import layouts
from pipeline.experiments.paper.bev_error import sighting
from pipeline.experiments.paper.layouts import LAYOUTS, LayoutCase
from pipeline.experiments.perception import eyes_for
from pipeline.experiments.straight_track import parameters
from pipeline.params import Params, with_changes
from pipeline.simulation.closed_loop import Setup, drive
from pipeline.simulation.sensors.rig import SensorRig

NEAREST_M, FARTHEST_M = 42.0, 48.0


def variants() -> dict[str, Params]:
    """Parameters by the name of the alignment."""
    base = parameters("ACC", 15.0)
    camera = SensorRig(layouts.scenario(LayoutCase("a", 0)), 100.0).camera
    fitted = angular_of(Pinhole(camera.K, camera.distortion, camera.T_camera_ego), camera)
    values = {
        "alignment.h_res_deg": float(np.degrees(fitted.h_res_rad)),
        "alignment.v_res_deg": float(np.degrees(fitted.v_res_rad)),
        "alignment.cx_px": fitted.cx,
        "alignment.cy_px": fitted.cy,
    }
    return {
        "pinhole": base,
        "angular, from the calibration": with_changes(base, {"alignment.model": "angular"}),
        "angular, fitted": with_changes(base, {"alignment.model": "angular", **values}),
    }


def lateral_errors(layout: str, params: Params, runs: int) -> list[float]:
    """Absolute errors in metres, of all frames at the distance."""
    found = []
    for seed in range(runs):
        setup = Setup(params, "camera", eyes_for("truth"), closed=False)
        for tick in drive(layouts.scenario(LayoutCase(layout, seed)), setup):
            seen = sighting(tick)
            if seen is not None and seen.error is not None and NEAREST_M <= seen.range_m <= FARTHEST_M:
                found.append(abs(seen.error.lateral_m))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    asked = parser.parse_args()
    by_name: Mapping[str, Params] = variants()
    print("| layout |", " | ".join(by_name), "|")
    for layout, title in LAYOUTS.items():
        cells = []
        for params in by_name.values():
            errors = lateral_errors(layout, params, asked.runs)
            cells.append(f"{np.mean(errors):.2f} m, {np.max(errors):.2f} m ({len(errors)})")
        print(f"| {title} |", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
