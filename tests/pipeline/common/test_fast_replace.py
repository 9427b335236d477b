"""Changing a frozen record leaves the old one alone and knows its fields."""

from __future__ import annotations

import dataclasses

import pytest

from pipeline.common.fast_replace import evolve
from tests.pipeline.build import fused


def test_it_does_what_replace_does() -> None:
    before = fused(1, 20.0)
    after = evolve(before, id=7, in_path=True)
    assert after == dataclasses.replace(before, id=7, in_path=True)
    assert (before.id, before.in_path) == (1, False)


def test_a_field_that_does_not_exist_is_refused() -> None:
    with pytest.raises(TypeError, match="FusedObject has no field colour"):
        evolve(fused(1, 20.0), colour="red")


def test_the_result_is_frozen_too() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        evolve(fused(1, 20.0), id=7).id = 8  # type: ignore[misc]
