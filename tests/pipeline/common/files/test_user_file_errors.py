"""What is wrong with a file, in one sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pipeline.common.errors import BadInput
from pipeline.common.files.user_file_errors import did_you_mean, first_complaint, given_path
from pipeline.params import Params, from_yaml
from pipeline.replay import faults
from pipeline.simulation import scenario
from pipeline.sources.rig import load_rig


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
        ({"title": "a", "wheels": {"radius_m": 1}}, "wheels: must be a list"),
        ({"title": "a", "wheels": [0.3]}, "wheels.0: must be a mapping of settings"),
        ([], "must be a mapping of settings"),
    ],
)
def test_the_first_complaint(data: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError) as raised:
        Car.model_validate(data)
    assert first_complaint(raised.value, Car) == sentence


def test_what_is_near_is_proposed() -> None:
    assert did_you_mean("cluster.zweight", ["acc.gap_s", "cluster.z_weight"]) == "; did you mean cluster.z_weight?"
    assert did_you_mean("xyz", ["cluster.z_weight"]) == ""


ALIASES = b"a0: &a0 [1, 2]\n" + b"".join(
    b"a%d: &a%d [%s]\n" % (n, n, b", ".join([b"*a%d" % (n - 1)] * 9)) for n in range(1, 12)
)
"""A few hundred bytes that represent thirty billion numbers."""


@pytest.mark.parametrize(
    ("content", "says"),
    [
        pytest.param(b"a: 2026-13-45", "not YAML: month must be in 1..12", id="a day in no calendar"),
        pytest.param(b"a: " + b"9" * 5000, "not YAML: Exceeds the limit", id="a number without end"),
        pytest.param(b"[" * 100_000, "not YAML: nested too deeply", id="nested without end"),
        pytest.param(b"a: !!timestamp x", "not YAML: a value does not match its tag", id="no time"),
        pytest.param(b"a: !!bool z", "not YAML: a value does not match its tag", id="no truth"),
        pytest.param(b'a: !!int ""', "not YAML: ", id="no number"),
        pytest.param(ALIASES, "not YAML: its aliases expand to more than 200000 values", id="aliases of aliases"),
        pytest.param(b"&a [*a]", "not YAML: its aliases expand", id="in itself"),
        pytest.param(b"a: {", "not YAML: while parsing", id="cut off"),
        pytest.param(b"\xff\xfe", "not YAML: not a text file", id="no text"),
        pytest.param(None, "cannot be read: No such file", id="no file"),
    ],
)
@pytest.mark.parametrize(
    "load",
    [
        pytest.param(lambda path: from_yaml(path, Params()), id="parameters"),
        pytest.param(load_rig, id="rig"),
        pytest.param(faults.load, id="faults"),
        pytest.param(lambda path: scenario.load(str(path)), id="scenario"),
    ],
)
def test_a_file_that_cannot_be_used_is_named_in_one_sentence(
    load: Callable[[Path], object], content: bytes | None, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "mine.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput) as refused:
        load(path)
    said = str(refused.value)
    assert f"mine.yaml: {says}" in said
    assert "\n" not in said


def test_an_address_in_a_store_is_no_path():
    with pytest.raises(BadInput, match=r"^s3://fleet/a\.bag: an address in a store; expected a file or folder"):
        given_path("s3://fleet/a.bag")
    assert given_path("~") == Path.home()
