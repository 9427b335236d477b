"""Pairs picked by hand: their fit, where they lie before and after, and why there is none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from app.engine.engine import Engine
from app.web.routes.alignment.pairs import MOST_PAIRS
from pipeline.alignment.projection import resolve
from pipeline.params import Params, with_changes
from tests.app.web.serving import running

TURNED = {"alignment.yaw_deg": 2.0, "alignment.pitch_deg": -1.0, "alignment.roll_deg": 0.5}
PLACES = ((8.0, 2.0, -0.8), (12.0, -3.0, 0.2), (20.0, 5.0, 1.0), (30.0, -6.0, 0.0), (15.0, 0.5, -1.0))


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with running() as engine:
        yield engine


def pairs_of(engine: Engine, places: tuple[tuple[float, float, float], ...] = PLACES) -> list[dict[str, Any]]:
    """Pixels of places in an image whose camera is turned."""
    camera = engine.snapshot.processed.frame.camera
    aligned = resolve(with_changes(Params(), TURNED).alignment, camera)
    pixels = aligned.project(np.array(places)).tolist()
    return [{"point": place, "pixel": pixel} for place, pixel in zip(places, pixels, strict=True)]


def test_pairs_are_fitted_and_nothing_changes(engine: Engine, client: httpx.Client):
    pairs = pairs_of(engine)
    found = client.post("/api/alignment/pairs", json={"pairs": pairs}).json()
    assert found["fit"]["changes"] == pytest.approx({"alignment.model": "pinhole", **TURNED}, abs=2e-3)
    assert set(found["fit"]["sigmas"]) == set(TURNED)
    np.testing.assert_allclose(found["fit"]["fitted"], [each["pixel"] for each in pairs], atol=0.1)
    camera = engine.snapshot.processed.frame.camera
    own = resolve(Params().alignment, camera).project(np.array(PLACES))
    np.testing.assert_allclose(found["present"], own, atol=0.006)
    assert "px → 0.0 px from their pixels (root mean square of 5 pairs)" in found["text"]
    assert engine.control.peek().params == Params()


def test_a_wrong_pair_is_named(engine: Engine, client: httpx.Client):
    pairs = pairs_of(engine)
    pairs[2]["pixel"][0] += 50.0
    found = client.post("/api/alignment/pairs", json={"pairs": pairs}).json()
    assert found["fit"]["outliers"] == [2]
    assert "pair 3 contradicts the others" in found["fit"]["warnings"][0]
    assert "of 4 pairs" in found["text"]


def test_a_cluster_counts_less(engine: Engine, client: httpx.Client):
    def sigma(kind: str) -> float:
        pairs = [{**each, "kind": kind} for each in pairs_of(engine)]
        fit = client.post("/api/alignment/pairs", json={"pairs": pairs}).json()["fit"]
        return float(fit["sigmas"]["alignment.yaw_deg"])

    assert sigma("cluster") > 1.5 * sigma("point")


def test_without_a_fit_it_says_why_and_where_the_points_are(engine: Engine, client: httpx.Client):
    found = client.post("/api/alignment/pairs", json={"pairs": pairs_of(engine)[:1]}).json()
    assert found["fit"] is None
    assert found["text"] == "No fit: 2 pairs are needed; 1 more"
    assert len(found["present"]) == 1
    behind = {"point": [-10.0, 0.0, 0.0], "pixel": [10.0, 10.0]}
    assert client.post("/api/alignment/pairs", json={"pairs": [behind]}).json()["present"] == [None]


def test_the_angular_model_and_the_position_are_fitted_where_asked(engine: Engine, client: httpx.Client):
    asked = {"pairs": pairs_of(engine), "model": "angular"}
    changes = client.post("/api/alignment/pairs", json=asked).json()["fit"]["changes"]
    assert set(changes) == {f"alignment.{each}" for each in ("model", "h_res_deg", "v_res_deg", "cx_px", "cy_px")}
    asked = {"pairs": pairs_of(engine), "offset": True}
    assert "alignment.left_m" in client.post("/api/alignment/pairs", json=asked).json()["fit"]["changes"]


@pytest.mark.parametrize(
    "body",
    [
        {"pairs": [{"point": [1.0, 2.0], "pixel": [0.0, 0.0]}]},
        {"pairs": [{"point": [1.0, 2.0, 3.0], "pixel": [0.0, "nan"]}]},
        {"pairs": [{"point": [1.0, 2.0, 3.0], "pixel": [0.0, 0.0], "kind": "car"}]},
        {"pairs": [{"point": [1.0, 2.0, 3.0], "pixel": [0.0, 0.0]}] * (MOST_PAIRS + 1)},
        {"pairs": [], "model": "fisheye"},
    ],
)
def test_what_is_no_pair_is_refused(client: httpx.Client, body: dict[str, Any]):
    assert client.post("/api/alignment/pairs", json=body).status_code == 422
