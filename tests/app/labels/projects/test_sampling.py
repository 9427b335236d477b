"""Which frames enter the queue."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from app.labels.projects.sampling import SampledDrive, Sampling, sample

TEN_HZ = [index * 100_000_000 for index in range(50)]
ADA, BOB = SampledDrive("a", TEN_HZ, {}), SampledDrive("b", TEN_HZ, {})


def test_every_second_is_by_time_and_not_by_frames() -> None:
    assert sample(Sampling(every_s=2), [ADA]) == {"a": [0, 20, 40]}
    with_gap = SampledDrive("a", [0, 1_900_000_000, 2_100_000_000, 9_000_000_000, 9_100_000_000], {})
    assert sample(Sampling(every_s=2), [with_gap]) == {"a": [0, 2, 3]}


def test_random_frames_depend_on_the_seed_alone() -> None:
    first = sample(Sampling(random=20, seed=7), [ADA, BOB])
    assert sum(map(len, first.values())) == 20
    assert all(first.values())
    assert sample(Sampling(random=20, seed=7), [BOB, ADA]) == first
    assert sample(Sampling(random=20, seed=8), [ADA, BOB]) != first
    assert sample(Sampling(random=1000, seed=7), [ADA]) == {"a": list(range(50))}


def test_the_worthiest_frames_are_a_second_apart() -> None:
    ada = SampledDrive("a", TEN_HZ, {10: 2.0, 11: 1.9, 30: 0.5, 40: 0.0})
    bob = SampledDrive("b", TEN_HZ, {10: 1.0})
    assert sample(Sampling(worth=2), [ada, bob]) == {"a": [10], "b": [10]}
    assert sample(Sampling(worth=9), [ada, bob]) == {"a": [10, 30], "b": [10]}


@pytest.mark.parametrize("rule", [{}, {"every_s": 2, "worth": 3}, {"every_s": 0}, {"random": 3, "seed": -1}])
def test_there_is_exactly_one_rule(rule: dict[str, float]) -> None:
    with pytest.raises(ValidationError):
        Sampling.model_validate(rule)
