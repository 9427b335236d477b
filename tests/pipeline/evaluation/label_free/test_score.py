"""Scores of drives whose faults are known."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.label_free.history import History
from pipeline.evaluation.label_free.score import SCORES, label_free_scores
from tests.pipeline.evaluation.label_free.histories import history, thing

GAP_S = 1.0


def value(drive, name: str) -> float | None:
    over, under = label_free_scores(drive, GAP_S)[name]
    return over / under if under else None


def test_a_steady_lead_has_no_faults():
    drive = history([(1, [thing(1, 30.0 - 0.1 * n)]) for n in range(60)])
    scores = label_free_scores(drive, GAP_S)
    assert set(scores) == {score.name for score in SCORES}
    for name in ("late_leads", "lead_doubted", "jitter"):
        assert value(drive, name) == pytest.approx(0.0, abs=1e-4), name


def test_an_empty_drive_has_no_score():
    assert all(under == 0.0 for _, under in label_free_scores(history([]), GAP_S).values())


def approach(error: float):
    """The camera alone until 3 s, with distances too far by a share; then both sensors."""
    frames = []
    for n in range(60):
        true = 50.0 - 0.5 * n
        seen = thing(1, true, closing_mps=5.0) if n >= 30 else thing(1, true * (1 + error), "V")
        frames.append((1, [seen]))
    return history(frames)


def test_the_cameras_distance_is_judged_once_the_lidar_has_measured():
    assert value(approach(0.0), "camera_distance") == pytest.approx(0.0, abs=0.5)
    assert value(approach(0.2), "camera_distance") == pytest.approx(20.0, abs=1.0)
    assert value(approach(-0.1), "camera_distance") == pytest.approx(10.0, abs=1.0)


def test_a_camera_that_is_never_proved_is_not_judged():
    drive = history([(1, [thing(1, 50.0 - 0.5 * n, "V")]) for n in range(60)])
    assert value(drive, "camera_distance") is None


def test_the_cameras_closing_speed_is_judged():
    frames = [
        (1, [thing(1, 50.0 - 0.5 * n, "VL" if n >= 30 else "V", closing_mps=5.0 if n >= 30 else 9.0)])
        for n in range(60)
    ]
    assert value(history(frames), "camera_speed") == pytest.approx(4.0, abs=0.3)


def test_a_lead_found_late_is_seen_in_hindsight():
    """For a second before it was chosen, it was the nearest object in the path."""
    drive = history([(1 if n >= 20 else None, [thing(1, 30.0, in_path=n >= 10)]) for n in range(60)])
    assert value(drive, "late_leads") == pytest.approx(100.0 * 10 / 60)
    assert value(drive, "lead_doubted") == pytest.approx(100.0 * 10 / 60)


def test_a_lead_that_cut_in_is_not_late():
    drive = history([(1 if n >= 20 else None, [thing(1, 30.0, in_path=n >= 20)]) for n in range(60)])
    assert value(drive, "late_leads") == 0.0


def test_one_behind_the_lead_is_not_late():
    """The nearer one leaves; the farther one was visible all the time."""
    frames = [(1 if n < 30 else 2, [thing(1, 20.0, in_path=n < 30), thing(2, 40.0)]) for n in range(60)]
    assert value(history(frames), "late_leads") == 0.0


def test_jitter_is_how_far_distances_leave_their_neighbours():
    drive = history([(1, [thing(1, 30.0 + 0.2 * (-1) ** n)]) for n in range(60)])
    assert value(drive, "jitter") == pytest.approx(0.4, abs=1e-3)
    assert value(history([(1, [thing(1, 30.0 + 0.01 * n * n)]) for n in range(60)]), "jitter") < 0.02


def test_nothing_is_judged_across_a_gap():
    """Two clips of a recording: the lead of the first says nothing about the second."""
    whole = history([(1, [thing(1, 30.0)]) for _ in range(40)])
    torn = History(
        _t_ns=[t + (5_000_000_000 if n >= 20 else 0) for n, t in enumerate(whole._t_ns)],
        _lead=[1 if n < 20 else -1 for n in range(40)],
        _parts=whole._parts,
    )
    assert value(torn, "jitter") == pytest.approx(0.0, abs=1e-6)
    over, under = label_free_scores(torn, GAP_S)["late_leads"]
    assert (over, under) == (0.0, 40.0)
    assert np.isfinite(over)
