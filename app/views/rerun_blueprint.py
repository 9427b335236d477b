"""How a replay opens: camera top left, the world beside it, bird's-eye view and reasons below, curves at the bottom."""

from __future__ import annotations

import rerun.blueprint as rrb

CAMERA = "world/camera"
OVERLAYS = f"{CAMERA}/overlay"
BEV_AHEAD_M, BEV_BEHIND_M, BEV_ASIDE_M = 80.0, 8.0, 24.0
_BACKGROUND = (13, 17, 23)


def blueprint() -> rrb.Blueprint:
    """The layout that a replay carries inside its file."""
    camera = rrb.Spatial2DView(name="Camera", origin=CAMERA, contents=[f"{CAMERA}/image", f"{OVERLAYS}/**"])
    world = rrb.Spatial3DView(
        name="World",
        origin="world",
        contents=["world/**", f"- {OVERLAYS}/**"],
        background=_BACKGROUND,
        eye_controls=rrb.EyeControls3D(
            position=(-16.0, 0.0, 11.0), look_target=(18.0, 0.0, 0.0), eye_up=(0.0, 0.0, 1.0)
        ),
    )
    bev = rrb.Spatial2DView(
        name="Bird's-eye view",
        origin="bev",
        background=_BACKGROUND,
        visual_bounds=rrb.VisualBounds2D(x_range=(-BEV_ASIDE_M, BEV_ASIDE_M), y_range=(-BEV_AHEAD_M, BEV_BEHIND_M)),
    )
    reasons = rrb.TextLogView(name="Reasons", origin="reasons")
    curves = rrb.Horizontal(
        _curve("Distance to the CIPV (m)", "curves/distance"),
        _curve("Closing speed (m/s)", "curves/closing_speed"),
        _curve("Time to collision (s)", "curves/ttc"),
        _curve("Speed (km/h)", "curves/speed"),
        _curve("Stage times (ms)", "curves/timing"),
    )
    left = rrb.Vertical(camera, rrb.Horizontal(bev, reasons, column_shares=[3, 2]), row_shares=[2, 3])
    return rrb.Blueprint(
        rrb.Vertical(rrb.Horizontal(left, world, column_shares=[1, 1]), curves, row_shares=[3, 1]),
        rrb.TimePanel(state="collapsed", timeline="sensor_time"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
    )


def _curve(name: str, origin: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(name=name, origin=origin, plot_legend=rrb.PlotLegend(visible=True))
