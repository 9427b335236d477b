"""The embedded network's law: kept with it, and right for the cars it was made for."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from pipeline.inference.model_registry import EMBEDDED
from pipeline.simulation.sensors.camera import HEIGHT, WIDTH
from pipeline.training.law import SeenPair, errors, fit, pairs
from pipeline.training.scenes import drive
from pipeline.types import REAL_VEHICLES
from pipeline.vision.detector import Detector, open_detector


@pytest.fixture(scope="module")
def detector() -> Detector:
    return open_detector(EMBEDDED, (WIDTH, HEIGHT))


@pytest.fixture(scope="module")
def seen(detector: Detector) -> list[SeenPair]:
    return list(pairs(detector, islice(drive("straight", 1.0), 14)))


def test_simulated_cars_are_as_far_as_the_networks_own_law_says(detector: Detector, seen: list[SeenPair]) -> None:
    """Within 6 % on average up to 60 m; with the law for real cars, they would be 10 % too far."""
    near = [row for row in errors(seen, detector.law)[:5] if row[0]]
    assert sum(count for count, _, _ in near) >= 20
    assert np.average([absolute for _, _, absolute in near], weights=[count for count, _, _ in near]) <= 0.06
    real = [row for row in errors(seen, REAL_VEHICLES)[:5] if row[0]]
    assert np.average([mean for _, mean, _ in real], weights=[count for count, _, _ in real]) > 0.08


def test_the_law_is_fitted_to_cars_and_trucks_and_not_to_vans() -> None:
    def of(label: str, kind: str, height_m: float) -> list[SeenPair]:
        return [SeenPair("0", label, 907.0 * height_m / d, d, d, kind) for d in (10.0, 20.0, 40.0)]

    law = fit([*of("car", "car", 1.5), *of("car", "van", 2.1), *of("truck", "truck", 3.0)])
    assert (law.coefficient, law.truck_ratio) == (pytest.approx(907.0 * 1.5, abs=0.1), 2.0)
    assert law.bus_ratio == REAL_VEHICLES.bus_ratio, "none seen"


def test_the_files_law_is_the_one_in_use(detector: Detector) -> None:
    assert detector.law != REAL_VEHICLES
    assert not any("law" in note for note in detector.notes)
