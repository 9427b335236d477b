"""The layout of a rerun recording: camera top left, the world beside it, plan and reasons below, curves at the
bottom."""

from __future__ import annotations

from typing import Any

import rerun.blueprint as rrb

from app.views.rerun.start_options import PLAYING, RerunStartOptions

CAMERA = "world/camera"
OVERLAYS = f"{CAMERA}/overlay"
BEV_AHEAD_M, BEV_BEHIND_M, BEV_ASIDE_M = 80.0, 8.0, 24.0
TTC_AXIS_S = 20.0
"""Longer times to collision are not shown."""
_BACKGROUND = (13, 17, 23)
_NO_LEGEND = rrb.PlotLegend(visible=False)


def blueprint(opening: RerunStartOptions = PLAYING) -> rrb.Blueprint:
    """The layout stored in the file."""
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
    reasons = rrb.TextLogView(
        name="Reasons",
        origin="reasons",
        columns=rrb.TextLogColumns(timeline_columns=["frame"], text_log_columns=["LogLevel", "Body"]),
        rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN"]),
    )
    curves = (
        _curve("Distance to the CIPV (m)", "distance"),
        _curve("Closing speed (m/s)", "closing_speed"),
        _curve("Time to collision (s)", "ttc", axis_y=rrb.ScalarAxis(range=(0.0, TTC_AXIS_S))),
        _curve("Speed (km/h)", "speed", plot_legend=rrb.PlotLegend(visible=True)),
        _curve("Stage times (ms)", "timing", plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)),
    )
    if opening.compact:
        layout = rrb.Vertical(camera, rrb.Tabs(world, bev, reasons, *curves, active_tab=0), row_shares=[2, 3])
    else:
        left = rrb.Vertical(camera, rrb.Horizontal(bev, reasons), row_shares=[2, 3])
        upper = rrb.Horizontal(left, world, column_shares=[1, 1])
        layout = rrb.Vertical(upper, rrb.Horizontal(*curves), row_shares=[3, 1])
    return rrb.Blueprint(
        layout,
        rrb.TimePanel(state="collapsed", timeline="sensor_time", play_state="paused" if opening.paused else None),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
    )


def _curve(name: str, curve: str, **options: Any) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(name=name, origin=f"curves/{curve}", **{"plot_legend": _NO_LEGEND, **options})
