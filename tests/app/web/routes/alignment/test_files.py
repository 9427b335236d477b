"""Calibrations of other tools: written with the current alignment, read as changes of it, refused with the mistake."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator

import httpx
import numpy as np
import pytest
import yaml

from app.engine.engine import Engine
from app.web.server import create_app
from pipeline.alignment.projection import corrected
from pipeline.params import Params, with_changes
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import WAIT_S, running, serving

TURNED = {"alignment.yaw_deg": 1.25, "alignment.pitch_deg": -0.5, "alignment.forward_m": 0.1, "alignment.up_m": 0.2}


@pytest.fixture
def engine() -> Iterator[Engine]:
    with running(source=Recording()) as engine:
        engine.wait_for(lambda s: s.processed is not None, WAIT_S)
        yield engine


@pytest.fixture
def client(engine: Engine) -> Iterator[httpx.Client]:
    with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


def exported(client: httpx.Client, name: str) -> list[dict[str, str]]:
    """The files of a format, as the page sends them."""
    answer = client.get("/api/alignment/export", params={"format": name})
    assert answer.status_code == 200, answer.text
    file = answer.headers["content-disposition"].partition("=")[2].strip('"')
    if not file.endswith(".zip"):
        return [{"name": file, "text": answer.text}]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as packed:
        return [{"name": each, "text": packed.read(each).decode()} for each in packed.namelist()]


@pytest.mark.parametrize("name", ["kitti", "ros", "opencv", "kalibr"])
def test_what_is_exported_is_imported_as_the_same_alignment(name: str, client: httpx.Client, engine: Engine):
    client.patch("/api/params", json={"changes": TURNED})
    files = exported(client, name)
    client.post("/api/params/undo")
    found = client.post("/api/alignment/import", json={"files": files}).json()
    assert found["warnings"] == []
    assert engine.control.peek().params.alignment == Params().alignment, "an import changes nothing by itself"
    camera = engine.snapshot.processed.frame.camera
    want, got = (corrected(with_changes(Params(), each).alignment, camera) for each in (TURNED, found["changes"]))
    np.testing.assert_allclose(got.T_camera_ego, want.T_camera_ego, atol=1e-4)
    client.patch("/api/params", json={"changes": found["changes"]})
    assert engine.control.peek().params.alignment.yaw_deg == pytest.approx(1.25, abs=1e-3)
    assert client.post("/api/params/undo").status_code == 200
    assert engine.control.peek().params.alignment == Params().alignment


def test_a_rig_file_is_written(client: httpx.Client):
    (file,) = exported(client, "rig")
    assert yaml.safe_load(file["text"])["camera"]["calibration"]["fx_px"] == pytest.approx(250.0)


def test_what_cannot_be_meant_is_refused_with_the_likely_mistake(client: httpx.Client):
    def refused(files: list[dict[str, str]]) -> str:
        answer = client.post("/api/alignment/import", json={"files": files})
        assert answer.status_code == 409, answer.text
        return answer.json()["detail"]

    ros = exported(client, "ros")
    assert "the static transform is missing" in refused(ros[:1])
    transform = yaml.safe_load(ros[1]["text"])
    inverted = {**transform, "header": {"frame_id": "lidar"}, "child_frame_id": "camera_optical"}
    assert "is its extrinsic inverted?" in refused([ros[0], {"name": "t", "text": yaml.safe_dump(inverted)}])
    degrees = {**transform["transform"], "rotation": {"roll": -90, "pitch": 0, "yaw": -90}}
    text = yaml.safe_dump({**transform, "transform": degrees})
    assert "these look like degrees" in refused([ros[0], {"name": "t", "text": text}])
    assert "a.txt: not a calibration" in refused([{"name": "../a.txt", "text": "hello"}])
    assert client.post("/api/alignment/import", json={"files": []}).status_code == 422
    assert client.get("/api/alignment/export", params={"format": "pdf"}).status_code == 422
