"""When vehicles make a turn certain."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.fusion.drift.estimate import AngleSightings, box_errors
from pipeline.fusion.drift.judge import MountTurn, judge

SIGMAS = 4.0


def turn(
    angles_deg: list[list[float]],
    tracks: tuple[int, ...] | None = None,
    lines_deg: list[float] | None = None,
    axis: int = 0,
) -> MountTurn | None:
    """angles_deg: of each vehicle in each time interval. tracks: of each vehicle; without it each has its own.
    lines_deg: shown by lane lines in each time interval."""
    values = np.array([*angles_deg, *([] if lines_deg is None else [lines_deg])]).T
    pieces, vehicles = values.shape
    piece, vehicle = (each.ravel() for each in np.meshgrid(np.arange(pieces), np.arange(vehicles), indexing="ij"))
    count, track = len(piece), vehicle if tracks is None else np.array(tracks)[vehicle]
    frames, rate = np.full(count, 5.0), np.zeros(count)
    new, lasting = box_errors(frames, np.full(count, 3.0), rate, np.zeros(count, bool), np.zeros(count))
    is_line = vehicle == (vehicles - 1 if lines_deg is not None else vehicles)
    new, lasting = np.where(is_line, 0.2, new), np.where(is_line, 0.5, lasting)
    seen = AngleSightings(piece, vehicle, track, frames, rate, new, lasting, is_line)
    return judge(seen, values.ravel(), axis).turn(SIGMAS)


@pytest.mark.parametrize(
    ("each_deg", "is_told"),
    [
        ((1.5, 1.4, 1.6), True),
        ((1.5, 1.4), True),
        ((1.5,), False),
        ((0.1, -0.1, 3.0, 0.0), False),
        ((3.0, -3.0, 2.5, -2.0, 2.8), False),
        ((0.2,) * 12, False),
    ],
    ids=["three", "two", "one, for a short time", "one wrong pair", "crossing both ways", "too small to matter"],
)
def test_vehicles_must_agree(each_deg: tuple[float, ...], is_told: bool):
    assert (turn([[angle] * 16 for angle in each_deg]) is not None) is is_told


def test_a_track_whose_size_jumps_is_still_one_witness():
    both = [[1.5] * 16, [1.4] * 16]
    assert turn(both) is not None
    assert turn(both, tracks=(0, 0)) is None


def test_the_moment_is_found():
    found = turn([[0.1] * 20 + [1.1] * 12, [-0.1] * 20 + [0.9] * 12])
    assert found is not None
    assert found.since == 20
    assert found.angle_deg == pytest.approx(1.0, abs=0.2)


def test_a_single_vehicle_is_believed_when_it_was_followed_before_or_for_long():
    assert turn([[1.5] * 24]) is not None
    found = turn([[0.2] * 16 + [1.7] * 16])
    assert found is not None
    assert found.vehicles == 1
    assert turn([[0.2] * 2 + [1.7] * 16]) is None


def test_lines_show_a_turn_without_any_vehicle():
    found = turn([], lines_deg=[0.7] * 16 + [1.7] * 12)
    assert found is not None
    assert found.by_lines
    assert found.since == 16
    assert found.angle_deg == pytest.approx(1.0, abs=0.35), "the level is how the LiDAR is mounted in the car"
    assert turn([], lines_deg=[1.0] * 40) is None


@pytest.mark.parametrize("axis", [0, 1], ids=["yaw", "pitch"])
def test_half_a_degree_is_shown_by_its_step_but_not_by_its_level(axis: int):
    """Errors that all vehicles share are in a level, but cancel in a step."""
    stepping = [[0.0] * 40 + [0.5] * 40] * 3
    found = turn(stepping, axis=axis)
    assert found is not None
    assert found.since == 40
    assert turn([[0.5] * 80] * 3, axis=axis) is None
    lines = turn([], lines_deg=[0.7] * 40 + [1.2] * 40, axis=axis)
    assert lines is not None
    assert lines.angle_deg == pytest.approx(0.5, abs=0.35)


def test_lines_confirm_small_turns_and_contradict_vehicles_that_err():
    quiet, shifted = [0.0] * 16 + [0.35] * 16, [0.0] * 16 + [0.9] * 16
    assert turn([quiet, quiet]) is None
    confirmed = turn([quiet, quiet], lines_deg=quiet)
    assert confirmed is not None
    assert confirmed.by_lines
    assert turn([shifted] * 3) is not None
    assert turn([shifted] * 3, lines_deg=[0.0] * 32) is None
