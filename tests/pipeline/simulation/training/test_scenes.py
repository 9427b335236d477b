"""Random traffic: the same seed gives the same bytes, and pictures hold what a detector must learn."""

from __future__ import annotations

import itertools

import numpy as np

from pipeline.geometry import iou_matrix
from pipeline.simulation.camera import calibration
from pipeline.simulation.training.labels import CLASSES, labels
from pipeline.simulation.training.scenes import MOMENTS_A_ROAD, drive, moments, random_road, random_traffic, size_models


def test_equal_seeds_give_equal_pictures_and_others_do_not() -> None:
    first, again, other = ([moment.picture.tobytes() for moment in moments(seed, 2)] for seed in (5, 5, 6))
    assert first == again
    assert not set(first) & set(other)


def test_traffic_holds_every_kind_near_and_far_and_nobody_overlaps() -> None:
    rng = np.random.default_rng(3)
    models, kinds, distances = size_models(rng), set(), []
    for _ in range(30):
        road = random_road(rng)
        scenario = random_traffic(rng, road, models)
        by_lane: dict[int, list[tuple[float, float]]] = {}
        for actor in scenario.actors:
            kinds.add(actor.kind)
            distances.append(actor.ahead_m)
            by_lane.setdefault(actor.lane, []).append((actor.ahead_m, actor.ahead_m + actor.size()[0]))
        for spans in by_lane.values():
            assert all(end < start for (_, end), (start, _) in itertools.pairwise(spans))
    assert kinds == {"car", "van", "truck", "bus", "motorcycle"}
    assert min(distances) < 4.0
    assert max(distances) > 100.0


def test_pictures_are_labelled_with_all_classes() -> None:
    found = {label.label for moment in moments(4, 12) for label in labels(moment.world, calibration())}
    assert found == set(range(len(CLASSES)))
    assert MOMENTS_A_ROAD >= 2


def test_a_drive_follows_its_scenario() -> None:
    first, second = list(drive("straight", 10.0))
    assert (first.world.t_s, second.world.t_s) == (0.0, 10.0)
    assert first.picture.tobytes() != second.picture.tobytes()
    truth = np.array([label.box for label in labels(first.world, calibration())])
    assert np.array_equal(np.diag(iou_matrix(truth, truth)), np.ones(len(truth)))
