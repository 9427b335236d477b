"""A law belongs to the weights it was measured for, travels with them, and is used unless a parameter is set."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.errors import BadInput
from pipeline.inference import model_registry
from pipeline.inference.distance_laws import find_law, keep_law, law_file
from pipeline.params import DistanceParams
from pipeline.types import REAL_VEHICLES, DistanceLaw
from pipeline.vision.detector import open_detector
from pipeline.vision.distance import law_in_use
from tests.pipeline.vision.networks import yolox

LAW = DistanceLaw(1300.0, -1.0, 1000.0, truck_ratio=2.5, bus_ratio=2.1, motorcycle_ratio=1.0)


@pytest.fixture
def network(tmp_path: Path) -> Path:
    return yolox(tmp_path / "own.onnx")


def test_a_kept_law_is_found_again_and_says_what_it_was_fitted_to(network: Path) -> None:
    assert find_law(network).law is None
    kept = keep_law(network, LAW, {"to": "a drive"})
    assert find_law(network).law == LAW
    assert json.loads(kept.read_text())["fitted"] == {"to": "a drive"}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        pytest.param("{", "damaged", id="no JSON"),
        pytest.param("[]", "damaged", id="no mapping"),
        pytest.param('{"law": {}, "network_sha256": ""}', "damaged", id="numbers missing"),
        pytest.param(json.dumps({"law": asdict(LAW), "network_sha256": "00"}), "other weights", id="other weights"),
        pytest.param(
            json.dumps({"law": asdict(LAW) | {"exponent": 1.0}, "network_sha256": ""}), "implausible", id="a rising law"
        ),
        pytest.param(
            json.dumps({"law": asdict(LAW) | {"focal_px": float("nan")}, "network_sha256": ""}), "implausible", id="NaN"
        ),
    ],
)
def test_a_law_that_cannot_be_meant_is_not_used_and_the_detector_says_why(network: Path, text: str, why: str) -> None:
    law_file(network).write_text(text)
    assert find_law(network).law is None
    detector = open_detector(str(network), None)
    assert detector.law == REAL_VEHICLES
    assert any(why in note for note in detector.notes)


def test_boxes_carry_their_detectors_law_and_a_new_law_is_a_new_detector_for_caches(network: Path) -> None:
    image = np.zeros((64, 64, 3), np.uint8)
    before = open_detector(str(network), None)
    assert before.detect(image).law == REAL_VEHICLES
    keep_law(network, LAW, {})
    after = open_detector(str(network), None)
    assert after.detect(image).law == LAW
    assert after.name != before.name
    assert not after.notes


def test_a_registered_network_brings_its_law_and_loses_it_with_its_weights(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CIPV_HOME", str(tmp_path / "home"))
    keep_law(network, LAW, {})
    model_registry.register(network, "mine")
    assert {entry.name: entry.law for entry in model_registry.list_models()}["mine"] == LAW
    model_registry.register(yolox(tmp_path / "other.onnx", (96, 96)), "mine")
    assert {entry.name: entry.law for entry in model_registry.list_models()}["mine"] is None


def test_a_place_that_cannot_be_written_to_is_named(network: Path) -> None:
    law_file(network).mkdir()
    with pytest.raises(BadInput, match=r"own\.law\.json cannot be written"):
        keep_law(network, LAW, {})


@given(st.floats(200.0, 4000.0), st.floats(10.0, 300.0), st.floats(-1.5, -0.7))
def test_a_law_says_the_same_for_every_camera(focal_px: float, height_px: float, exponent: float) -> None:
    """A camera with twice the focal length sees boxes twice as tall, at the same distances."""
    law = DistanceLaw(1300.0, exponent, 1000.0, 1.0, 1.0, 1.0)
    other = law.at_focal(focal_px)
    seen_px = height_px * focal_px / law.focal_px
    assert other.coefficient * seen_px**exponent == pytest.approx(law.coefficient * height_px**exponent)


def test_what_a_parameter_says_stands_in_place_of_the_detectors_own() -> None:
    own = LAW.at_focal(907.0)
    assert law_in_use(DistanceParams(), LAW) == own
    told = law_in_use(DistanceParams(coefficient=1500.0, truck_ratio=3.0), LAW)
    assert (told.coefficient, told.truck_ratio) == (1500.0, 3.0)
    assert (told.exponent, told.bus_ratio, told.motorcycle_ratio) == (own.exponent, own.bus_ratio, own.motorcycle_ratio)


def test_real_vehicles_are_measured_to_the_bit_as_before_there_were_laws() -> None:
    law = law_in_use(DistanceParams(), REAL_VEHICLES)
    assert (law.coefficient, law.exponent) == (1444.0, -1.0)
    assert (law.truck_ratio, law.bus_ratio, law.motorcycle_ratio) == (1.6, 2.0, 0.75)
