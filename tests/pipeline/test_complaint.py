"""What is wrong with a file, in one sentence."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pipeline.complaint import did_you_mean, first_complaint


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Wheel(Strict):
    radius_m: float = 0.3


class Engine(Strict):
    power_kw: float
    cylinders: int
    fuel: str = "petrol"


class Car(Strict):
    title: str
    mass_kg: float = Field(1500.0, gt=0.0)
    wheels: list[Wheel] | None = None
    engine: Engine | None = None

    @model_validator(mode="after")
    def _check(self) -> Car:
        if self.wheels == []:
            raise ValueError("a car without wheels")
        return self


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({"title": "a", "mass_gk": 3}, "mass_gk: no such setting; did you mean mass_kg?"),
        ({"title": "a", "colour": 3}, "colour: no such setting"),
        ({"title": "a", "wheels": [{}, {"radius": 1}]}, "wheels.1.radius: no such setting; did you mean radius_m?"),
        ({}, "title: is missing"),
        ({"title": "a", "engine": {}}, "engine.power_kw, engine.cylinders: are missing"),
        ({"engine": {}}, "title: is missing"),
        ({"title": "a", "mass_kg": -1}, "mass_kg: Input should be greater than 0"),
        ({"title": "a", "wheels": []}, "a car without wheels"),
    ],
)
def test_the_first_complaint(data: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError) as raised:
        Car.model_validate(data)
    assert first_complaint(raised.value, Car) == sentence


def test_what_is_near_is_proposed() -> None:
    assert did_you_mean("cluster.zweight", ["acc.gap_s", "cluster.z_weight"]) == "; did you mean cluster.z_weight?"
    assert did_you_mean("xyz", ["cluster.z_weight"]) == ""
