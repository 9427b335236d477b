"""The detector that comes with the program, on pictures it was not trained on. Floors lie a little under what
``python -m pipeline.simulation.training.evaluate`` measures on many more."""

from __future__ import annotations

from functools import reduce
from itertools import chain, islice
from operator import add

import pytest

from pipeline.simulation.camera import HEIGHT, WIDTH
from pipeline.simulation.training.evaluate import EDGES_M, Bin, evaluate
from pipeline.simulation.training.scenes import drive, moments
from pipeline.vision.detector import Detector, open_detector
from pipeline.vision.models import EMBEDDED

UNSEEN_SEED = 2


@pytest.fixture(scope="module")
def detector() -> Detector:
    return open_detector(EMBEDDED, (WIDTH, HEIGHT))


@pytest.fixture(scope="module")
def random_traffic(detector: Detector) -> list[Bin]:
    return evaluate(detector, moments(UNSEEN_SEED, 40))


@pytest.fixture(scope="module")
def built_in(detector: Detector) -> list[Bin]:
    """Moments of built-in scenarios: following and cut in, a bend, a crossing."""
    drives = (islice(drive(name, 2.0), 7) for name in ("straight", "curve_250", "turn_across_left"))
    return evaluate(detector, chain.from_iterable(drives))


def _within(bins: list[Bin], far_m: float) -> Bin:
    """Several bins as one: every count is the sum of theirs."""
    near = [vars(part).values() for part, end_m in zip(bins, EDGES_M[1:], strict=True) if end_m <= far_m]
    return Bin(*(reduce(add, counts) for counts in zip(*near, strict=True)))


def test_it_runs_as_a_yolox_network_at_the_simulator_s_size(detector: Detector) -> None:
    assert detector.head == "yolox"
    assert detector.input_size == (384, 640)
    assert detector.labels == ("car", "truck", "bus", "motorcycle")


def test_the_lead_is_found(random_traffic: list[Bin], built_in: list[Bin]) -> None:
    for bins, floor in ((random_traffic, 0.95), (built_in, 0.97)):
        near = _within(bins, 60.0)
        assert near.leads >= 8
        assert near.lead_recall() >= floor


def test_most_vehicles_are_found_and_little_else(random_traffic: list[Bin], built_in: list[Bin]) -> None:
    for bins in (random_traffic, built_in):
        near = _within(bins, 60.0)
        assert near.vehicles >= 40
        assert near.recall() >= 0.85
        assert near.precision() >= 0.87
        assert near.class_accuracy() >= 0.95


def test_the_height_of_a_box_tells_the_distance(random_traffic: list[Bin], built_in: list[Bin]) -> None:
    for bins in (random_traffic, built_in):
        assert _within(bins, 60.0).height_error() <= 0.07
