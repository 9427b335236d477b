"""The words of the alignment's score."""

from __future__ import annotations

import pytest

from app.web.routes.alignment.score import _json
from pipeline.calibration.edge_match import EdgeScore
from pipeline.calibration.local_match import NO_MATCH


@pytest.mark.parametrize(
    ("found", "brief", "told"),
    [
        (EdgeScore(None, None, 40), "too few edges", "Too few LiDAR depth edges"),
        (EdgeScore(None, 3.1, 900), "no clear best", "No mount rotation within 3°"),
        (
            EdgeScore(None, 3.1, 900, {"yaw_deg": 2.5}),
            "by vehicles: yaw +2.5°",
            "vehicles ask for yaw +2.5°",
        ),
        (EdgeScore(0.97, 6.0, 900), "97 %", "clearly better than the current one (900 depth edges in 20 frames)"),
        (
            EdgeScore(0.12, 6.0, 900, {"yaw_deg": -2.0, "pitch_deg": 0.5}),
            "12 % · better yaw -2°, pitch +0.5°",
            "better with yaw -2°, pitch +0.5°",
        ),
        (EdgeScore(0.5, 6.0, 900, {"cx_px": -20.0}), "50 % · better cx -20 px", "better with cx -20 px"),
        (EdgeScore(0.0, 6.0, 900, {"h_res_deg": 0.95, "v_res_deg": 0.95}), "0 % · better h_res and v_res × 0.95", ""),
    ],
    ids=["few", "flat", "by vehicles", "right", "turned", "slid", "zoomed"],
)
def test_a_score_in_words(found: EdgeScore, brief: str, told: str):
    said = _json(found, NO_MATCH, 20)
    assert said.brief == brief
    assert told in said.text
    assert said.better == dict(found.better)


def test_without_an_image_there_is_nothing_to_match():
    said = _json(EdgeScore(None, None, 0), NO_MATCH, 0)
    assert (said.score, said.brief) == (None, "nothing to match")
    assert "both an image and LiDAR points" in said.text
