"""Vehicles tell the pitch that edges of drawn images do not show, and the yaw where no match of edges stands out."""

from __future__ import annotations

import pytest

from pipeline.alignment.projection import resolve
from pipeline.calibration.alignment.scenes import FitScene
from pipeline.calibration.edge_match import EdgeScore
from pipeline.calibration.vehicle_match import with_vehicles
from pipeline.params import AlignmentParams
from tests.pipeline.calibration.alignment.made_drive import CAMERA, drive


@pytest.fixture(scope="module")
def scenes() -> list[FitScene]:
    aligned = resolve(AlignmentParams(), CAMERA)
    assert aligned is not None
    return drive(aligned)


def scored(score: float | None, **better: float) -> EdgeScore:
    return EdgeScore(score, 6.0, 900, better)


@pytest.mark.parametrize(
    ("present", "edges", "better"),
    [
        ({"pitch_deg": 1.5}, scored(0.2, yaw_deg=1.75, pitch_deg=-3.0), {"yaw_deg": 1.75, "pitch_deg": -1.5}),
        ({"pitch_deg": -2.0}, scored(0.9), {"pitch_deg": 2.0}),
        ({}, scored(0.7, pitch_deg=-1.5), {}),
        ({"yaw_deg": 0.25, "roll_deg": 0.5, "pitch_deg": -0.2}, scored(0.9), {}),
        ({"yaw_deg": 2.0, "pitch_deg": -2.0}, scored(None), {"yaw_deg": -2.0, "pitch_deg": 2.0}),
        ({"model": "angular"}, scored(0.5, cy_px=12.0), {"cy_px": 12.0}),
    ],
    ids=["pitch of edges is wrong", "edges show none", "none is needed", "about right", "no edges match", "angular"],
)
def test_vehicles_tell_the_pitch(scenes: list[FitScene], present: dict, edges: EdgeScore, better: dict[str, float]):
    found = with_vehicles(edges, scenes, AlignmentParams(**present))
    assert found.better == better
    assert (found.score, found.sigmas, found.borders) == (edges.score, edges.sigmas, edges.borders)


def test_few_vehicles_tell_nothing(scenes: list[FitScene]):
    edges = scored(0.7, pitch_deg=-1.5)
    assert with_vehicles(edges, scenes[:1], AlignmentParams(pitch_deg=1.0)) == edges
    assert with_vehicles(edges, [], AlignmentParams(pitch_deg=1.0)) == edges
