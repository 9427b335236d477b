"""Timeline and what-if over HTTP, as the page uses them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from app.drive.frame_rows import column_names
from app.drive.marks import Marks
from app.engine.engine import Engine
from app.web.server import create_app
from pipeline.calibration.edge_match import FEWEST
from pipeline.detection import Detectors
from pipeline.params import Params, from_yaml, preset, with_changes
from pipeline.recording.session.provenance import About
from pipeline.recording.session.writer import SessionWriter
from pipeline.run import run
from pipeline.sources import open_source
from tests.app.engine.recording_helpers import CountingDetector, Recording, opener
from tests.app.web.serving import WAIT_S, running, serving


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    with running(whole_drives=True) as engine:
        yield engine


@contextmanager
def client_of(engine: Engine, marks: Marks | None = None) -> Iterator[httpx.Client]:
    with serving(create_app(engine, marks=marks)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
        yield client


@pytest.fixture(scope="module")
def client(engine: Engine) -> Iterator[httpx.Client]:
    with client_of(engine) as client:
        yield client


@pytest.fixture(autouse=True)
def _at_the_start(engine: Engine) -> None:
    """Each test begins paused at the first frame of a newly opened recording whose drive is computed."""
    engine.control.set_params(Params(), "default")
    before = engine.drives.recording
    engine.control.change(uri="test:car", playing=False, target=None, steps=0)
    engine.wait_for(
        lambda s: engine.drives.recording is not before and s.index == 0 and s.processed is not None, WAIT_S
    )
    computed(engine)


def computed(engine: Engine) -> int:
    """Wait until the drive is computed with the current parameters; returns the run's number."""
    wanted = engine.control.peek().params
    shown = engine.wait_for(
        lambda s: s.params == wanted and s.drive.run is not None and s.drive.phase == "done" and s.drive.done == 30,
        WAIT_S,
    )
    assert shown.drive.run is not None
    return shown.drive.run


def change(client: httpx.Client, engine: Engine, **changes: Any) -> int:
    answer = client.patch("/api/params", json={"changes": {name.replace("__", "."): v for name, v in changes.items()}})
    assert answer.status_code == 200
    return computed(engine)


# ------------------------------------------------------------ the drive


def test_columns_are_the_command_lines(client: httpx.Client, engine: Engine):
    answer = client.get("/api/drive").json()
    results = [result for _, result in run(Recording(), Params(), Detectors(CountingDetector()))]
    assert (answer["count"], answer["from"], answer["done"]) == (30, 0, 30)
    assert answer["t_s"] == pytest.approx([0.1 * n for n in range(30)])
    assert answer["clips"] == [0]
    assert tuple(answer["columns"]) == column_names()
    assert answer["columns"]["cipv_id"] == [r.cipv.id if r.cipv else None for r in results]
    assert answer["columns"]["distance_m"] == [round(r.cipv.distance_m, 4) if r.cipv else None for r in results]
    assert answer["columns"]["gaps"] == [""] * 30


def test_columns_are_asked_for_piece_by_piece(client: httpx.Client):
    whole = client.get("/api/drive").json()
    piece = client.get("/api/drive?from=20").json()
    assert (piece["from"], piece["done"], piece["t_s"], piece["clips"]) == (20, 30, [], [])
    assert piece["columns"]["distance_m"] == whole["columns"]["distance_m"][20:]
    nothing = client.get("/api/drive?from=99").json()
    assert (nothing["from"], nothing["done"]) == (30, 30)
    assert all(column == [] for column in nothing["columns"].values())
    assert client.get("/api/drive?from=-1").status_code == 422


def test_one_object_over_the_drive(client: httpx.Client):
    lead = client.get("/api/drive").json()["columns"]["cipv_id"][-1]
    curve = client.get(f"/api/drive/object/{lead}").json()
    assert curve["index"] == list(range(30))
    assert curve["distance_m"][5] == pytest.approx(28.0, abs=0.1)
    assert client.get("/api/drive/object/999").json()["index"] == []
    assert client.get(f"/api/drive/object/{lead}?run=77").status_code == 404


def test_events_and_marks_on_one_line(client: httpx.Client, engine: Engine):
    revision = engine.snapshot.drive.revision
    first = client.post("/api/marks", json={"index": 7, "text": "look here"})
    assert first.status_code == 201
    engine.wait_for(lambda s: s.drive.revision > revision, WAIT_S)
    shown = client.post("/api/marks", json={}).json()
    assert shown["index"] == engine.snapshot.index
    events = client.get("/api/drive/events").json()["events"]
    assert {event["kind"] for event in events} >= {"first_acquisition", "mark"}
    assert [event["index"] for event in events] == sorted(event["index"] for event in events)
    marked = next(event for event in events if event["text"] == "look here")
    assert (marked["index"], marked["t_s"], marked["mark"]) == (7, pytest.approx(0.7), first.json()["id"])
    for made in (first.json(), shown):
        assert client.delete(f"/api/marks/{made['id']}").status_code == 200
    assert client.delete(f"/api/marks/{shown['id']}").status_code == 404
    assert not [e for e in client.get("/api/drive/events").json()["events"] if e["kind"] == "mark"]


@pytest.mark.parametrize("body", [{"index": 30}, {"index": -1}, {"text": "x" * 500}, {"index": "x"}])
def test_what_is_no_mark_is_refused(client: httpx.Client, body: dict[str, Any]):
    answer = client.post("/api/marks", json=body)
    assert answer.status_code == 422
    assert isinstance(answer.json()["detail"], str)


def test_marks_outlive_the_server(engine: Engine, tmp_path: Path):
    with client_of(engine, Marks(tmp_path)) as client:
        client.post("/api/marks", json={"index": 3, "text": "kept"})
    with client_of(engine, Marks(tmp_path)) as client:
        assert "kept" in [event["text"] for event in client.get("/api/drive/events").json()["events"]]


def test_marks_made_while_a_session_was_recorded_are_events_of_it(tmp_path: Path):
    writer = SessionWriter(tmp_path / "a.mcap", About("test:car", "a car", 10.0))
    for index in range(4):
        writer.write(Recording().frame(index))
        if index == 2:
            writer.write_mark("he braked")
    writer.close()
    session = open_source(str(tmp_path / "a.mcap"))
    with running(whole_drives=True, source=session) as engine, client_of(engine) as client:
        engine.wait_for(lambda s: s.drive.done == 4, WAIT_S)
        client.post("/api/marks", json={"index": 1, "text": "seen later"})
        events = [event for event in client.get("/api/drive/events").json()["events"] if event["kind"] == "mark"]
        assert [(event["index"], event["text"], event["mark"]) for event in events] == [
            (1, "seen later", 1),
            (2, "he braked", None),
        ]


# ------------------------------------------------------------ what if


def test_a_changed_threshold_is_compared_with_before(client: httpx.Client, engine: Engine):
    base = computed(engine)
    new = change(client, engine, detection__min_score=0.9, cipv__min_width_m=3.0)
    found = client.get("/api/compare").json()
    assert (found["base"], found["run"], found["done"], found["truth"]) == (base, new, 30, None)
    assert found["differing"] == [[0, 29]], "without its box, and too small for a lead, the car leads in no frame"
    assert found["first"] == {"0": "compared run: #1 at 30.0 m; shown run: none"}
    figures = {each["name"]: (each["base"], each["run"]) for each in found["metrics"]}
    assert figures["frames with a CIPV"] == (30, 0)
    same = client.get(f"/api/compare?base={new}&run={new}").json()
    assert same["frames_differing"] == 0
    assert client.get("/api/compare?base=99").status_code == 404


def test_runs_are_labelled_kept_taken_and_deleted(client: httpx.Client, engine: Engine):
    base = computed(engine)
    new = change(client, engine, cipv__confirm_hits=5)
    listed = client.get("/api/runs").json()
    assert (listed["base"], listed["run"]) == (base, new)
    first, second = listed["runs"]
    assert (first["label"], second["label"]) == ("preset default", "cipv.confirm_hits 3 → 5")
    assert second["changes"] == {"cipv.confirm_hits": [3, 5]}
    assert first["digest"] != second["digest"]
    kept = client.post(f"/api/runs/{new}/keep", json={"name": "five hits"}).json()["runs"][1]
    assert (kept["kept"], kept["name"]) == (True, "five hits")
    assert client.delete(f"/api/runs/{new}").status_code == 409
    client.post(f"/api/runs/{base}/use")
    assert computed(engine) == base
    assert client.get("/api/params").json()["values"]["cipv.confirm_hits"] == 3
    assert client.post("/api/params/undo").json()["values"]["cipv.confirm_hits"] == 5, "taking a run can be undone"
    client.post("/api/params/redo")
    computed(engine)
    assert client.post(f"/api/runs/{new}/base").json()["base"] == new
    assert client.delete(f"/api/runs/{new}").status_code == 409
    client.post(f"/api/runs/{base}/base")
    assert [each["id"] for each in client.delete(f"/api/runs/{new}").json()["runs"]] == [base]
    assert client.get(f"/api/runs/{new}/columns").status_code == 404


def test_a_runs_preset_file_is_one_for_the_command_line(client: httpx.Client, engine: Engine, tmp_path: Path):
    new = change(client, engine, cluster__z_weight=0.25)
    answer = client.get(f"/api/runs/{new}/params.yaml")
    assert "attachment" in answer.headers["content-disposition"]
    assert yaml.safe_load(answer.text)["cluster"]["z_weight"] == 0.25
    file = tmp_path / "run.yaml"
    file.write_text(answer.text, encoding="utf-8")
    assert from_yaml(file, preset("paper")) == with_changes(Params(), {"cluster.z_weight": 0.25})


def test_a_dragged_slider_is_no_step_and_no_run(client: httpx.Client, engine: Engine):
    before, can_undo = client.get("/api/runs").json(), client.get("/api/params").json()["can_undo"]
    change_it = {"changes": {"cipv.confirm_hits": 9}, "final": False}
    dragged = client.patch("/api/params", json=change_it).json()
    assert (dragged["values"]["cipv.confirm_hits"], dragged["can_undo"]) == (9, can_undo)
    engine.wait_for(lambda s: s.params_revision == dragged["revision"], WAIT_S)
    assert client.get("/api/runs").json() == before
    assert client.post("/api/params/undo").json()["values"]["cipv.confirm_hits"] == 3


def test_nothing_to_undo_is_said(client: httpx.Client, engine: Engine):
    while client.post("/api/params/undo").status_code == 200:
        pass
    answer = client.post("/api/params/undo")
    assert (answer.status_code, answer.json()) == (409, {"detail": "nothing to undo"})
    change(client, engine, cipv__confirm_hits=4)
    assert client.post("/api/params/redo").status_code == 409


def test_every_parameter_replaced_at_once(client: httpx.Client, engine: Engine):
    answer = client.post("/api/params", json={"preset": "paper", "values": {"cluster.z_weight": 0.5}}).json()
    assert (answer["preset"], answer["values"]["cluster.z_weight"]) == ("paper", 0.5)
    assert engine.control.peek().params == with_changes(preset("paper"), {"cluster.z_weight": 0.5})
    bad = client.post("/api/params", json={"preset": "paper", "values": {"cluster.z_weight": 50}})
    assert bad.status_code == 422
    assert "z_weight" in bad.json()["detail"]


# ------------------------------------------------------------ clips, replays


def test_a_clip_is_made_in_the_background_and_downloaded(client: httpx.Client, engine: Engine):
    revision = engine.snapshot.drive.revision
    job = client.post("/api/clip", json={"first": 3, "last": 9, "kind": "csv"})
    assert job.status_code == 202
    number = job.json()["id"]
    engine.wait_for(lambda s: s.drive.revision > revision, WAIT_S)
    done = client.get(f"/api/jobs/{number}").json()
    assert (done["state"], done["file"], done["progress"]) == ("done", "clip-000003-000009.csv", 1.0)
    file = client.get(f"/api/jobs/{number}/file")
    assert len(file.content) == done["bytes"]
    assert 'filename="clip-000003-000009.csv"' in file.headers["content-disposition"]
    assert file.text.count("True") >= 7
    assert client.delete(f"/api/jobs/{number}").status_code == 200
    assert client.get(f"/api/jobs/{number}/file").status_code == 404


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"first": 5, "last": 3, "kind": "csv"}, 409),
        ({"first": 0, "last": 30, "kind": "csv"}, 409),
        ({"first": 0, "last": 3, "kind": "exe"}, 422),
        ({"first": 0, "kind": "csv"}, 422),
    ],
)
def test_what_is_no_clip_is_refused(client: httpx.Client, body: dict[str, Any], status: int):
    answer = client.post("/api/clip", json=body)
    assert answer.status_code == status
    assert isinstance(answer.json()["detail"], str)


@pytest.mark.parametrize("number", ["j999", "..", "%2e%2e%2fetc%2fpasswd", "j1%00"])
def test_a_job_that_is_none_leads_nowhere(client: httpx.Client, number: str):
    assert client.get(f"/api/jobs/{number}/file").status_code == 404


def test_the_drive_as_a_replay(client: httpx.Client):
    answer = client.get("/api/rerun.rrd?first=4&last=6&paused=1")
    assert answer.content[:4] == b"RRF2"
    assert "drive-000004-000006.rrd" in answer.headers["content-disposition"]
    assert client.get("/api/rerun.rrd?first=99").status_code == 422


def test_without_a_whole_drive_the_routes_say_so():
    """As with live sensors."""
    engine = Engine(opener(Recording()), lambda _: CountingDetector(), Params(), uri="test:car")
    engine.start()
    try:
        engine.wait_for(lambda s: s.processed is not None, WAIT_S)
        with client_of(engine) as client:
            for route in ("/api/drive", "/api/compare", "/api/rerun.rrd", "/api/rerun/open"):
                assert client.get(route).status_code == 404
            assert client.get("/api/runs").json() == {"base": None, "run": None, "runs": []}
            assert client.get("/api/drive/events").json() == {"run": None, "events": []}
            assert client.get("/api/state").json()["drive"]["run"] is None
    finally:
        engine.stop()


def test_every_route_of_the_timeline_is_described(client: httpx.Client):
    paths = client.get("/openapi.json").json()["paths"]
    described = {path: methods for path, methods in paths.items() if path.startswith(("/api/drive", "/api/runs"))}
    assert len(described) >= 8
    for path, methods in described.items():
        for method, operation in methods.items():
            assert operation.get("description"), f"{method} {path}"


def test_the_alignment_is_scored(client: httpx.Client):
    """Each image of the small recording shows the sides of one car, and the edges of its points lie elsewhere."""
    found = client.get("/api/alignment/score").json()
    whole = {"score", "sigmas", "borders", "better", "brief", "text"}
    assert set(found) == whole | {"columns", "rows", "regions", "ranges"}
    assert len(found["regions"]) == found["columns"] * found["rows"]
    assert found["borders"] >= FEWEST
    assert found["score"] < 0.5
    assert found["brief"].startswith(f"{100 * found['score']:.0f} % · better ")
    assert set(found["better"]) <= {"yaw_deg", "pitch_deg", "roll_deg"}
    assert found == client.get("/api/alignment/score").json()
