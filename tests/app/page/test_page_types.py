"""What types.js of core, drive, labeling and align say of a message is what is sent: no key more, no key less."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.engine.engine import Engine
from app.engine.session_recording import SessionRecorder
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from app.web.routes.alignment.files import ImportJson
from app.web.routes.alignment.fit import FitResult
from app.web.routes.alignment.pairs import PairFitJson, PairsJson
from app.web.routes.alignment.progress import FitProgress
from app.web.routes.alignment.time import TimeFitResult
from app.web.server import create_app
from tests.app.engine.recording_helpers import Recording
from tests.app.web.serving import WAIT_S, running, serving

JS = Path(__file__).resolve().parents[3] / "static" / "js"


def typedefs(text: str) -> dict[str, set[str]]:
    """The keys of each ``@typedef {object} Name``, by name."""
    found: dict[str, set[str]] = {}
    name = ""
    for line in text.splitlines():
        if begun := re.match(r" \* @typedef \{object\} (\w+)", line):
            name = begun[1]
            found[name] = set()
        elif key := re.match(r" \* @property \{.*\} \[?(\w+)\]?", line):
            found[name].add(key[1])
    return found


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    """One real message of each type, by the type's name."""
    desk = SessionRecorder(tmp_path_factory.mktemp("sessions"))
    with running(desk, whole_drives=True, source=Recording(count=30)) as engine:
        engine.control.seek(28)
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            yield collect(engine, client)


def is_compared(shown: Snapshot) -> bool:
    """The shown frame comes from this run, and the whole drive has a second run."""
    drive = shown.state_json()["drive"]
    return not drive["running"] and drive["done"] == drive["total"] == 30 and drive["run"] != drive["base"]


def collect(engine: Engine, client: httpx.Client) -> dict[str, Any]:
    def get(path: str) -> Any:
        answer = client.get(path)
        assert answer.status_code == 200, (path, answer.text)
        return answer.json()

    engine.wait_for(lambda shown: shown.index == 28 and shown.processed is not None, WAIT_S)
    assert client.post("/api/marks", json={"text": "here"}).status_code == 201
    # the first run is the base only once a second one stands beside it
    engine.wait_for(lambda shown: not shown.state_json()["drive"]["running"], WAIT_S)
    assert client.patch("/api/params", json={"changes": {"path.half_width_m": 2.0}}).status_code == 200
    shown = engine.wait_for(is_compared, WAIT_S)
    message = Encoder().message(shown)
    assert message is not None
    header = json.loads(message[4 : 4 + struct.unpack("<I", message[:4])[0]])
    result, display, state = header["result"], header["display"], header["state"]
    assert result["cipv"] is not None, "the recording has a lead"
    params, columns, runs, comparison = (get(f"/api/{path}") for path in ("params", "drive", "runs", "compare"))
    job = client.post("/api/clip", json={"first": 0, "last": 1, "kind": "csv"}).json()
    every_param = [param for section in params["sections"] for param in section["params"]]
    return {
        "Gate": result["objects"][0]["gates"][0],
        "FusedObject": result["objects"][0],
        "Cipv": result["cipv"],
        "Path": result["path"],
        "Acc": result["acc"],
        "OwnMotion": result["own_motion"],
        "Result": result,
        "Notice": state["notices"][0],
        "State": state,
        "RecordingState": client.post("/api/recording", json={"on": True}).json(),
        "DriveState": state["drive"],
        "Display": display,
        "GroundPlanes": display["ground"],
        "Ranked": display["ranking"][0],
        "SentImage": header["picture"],
        "Param": {key: None for param in every_param for key in param},
        "ParamsAnswer": params,
        "Columns": columns["columns"],
        "ColumnsAnswer": columns,
        "DriveEvent": get("/api/drive/events")["events"][0],
        "ObjectCurve": get(f"/api/drive/object/{result['cipv']['id']}"),
        "Run": runs["runs"][0],
        "Metric": comparison["metrics"][0],
        "Comparison": comparison,
        "Job": job,
        "AlignmentScore": (alignment := get("/api/alignment/score")),
        "MatchRegion": alignment["regions"][0],
        "MatchRange": alignment["ranges"][0],
        "FitProgress": dict.fromkeys(FitProgress.model_fields),
        "AlignmentVersion": client.post("/api/alignment/versions", json={"note": ""}).json(),
        "AlignmentFitResult": dict.fromkeys(FitResult.model_fields),
        "AlignmentImport": dict.fromkeys(ImportJson.model_fields),
        "PairsAnswer": dict.fromkeys(PairsJson.model_fields),
        "PairFit": dict.fromkeys(PairFitJson.model_fields),
        "TimeFitResult": dict.fromkeys(TimeFitResult.model_fields),
        **labelled(engine, client),
    }


def labelled(engine: Engine, client: httpx.Client) -> dict[str, Any]:
    """Every message about labels."""

    drive = client.get("/api/labels").json()["drive"]["id"]

    def act(**what: Any) -> Any:
        answer = client.post("/api/labels/act", json={"person": "Ada", "act": what, "drive": drive})
        assert answer.status_code < 300, (what, answer.text)
        return answer.json()

    def get(path: str) -> Any:
        answer = client.get(f"/api/labels{path}")
        assert answer.status_code == 200, (path, answer.text)
        return answer.json()

    cuboid = {"center": [20.0, 0.0, 0.8], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.0}
    added = act(kind="add_track", label="car", frame=3, cuboid=cuboid, bbox=None)
    (track,) = added["changed"]["tracks"]
    act(kind="set_lead", first=3, last=5, lead=track["id"])
    act(kind="set_path", frame=3, left=[[0, 1], [5, 1]], right=None)
    act(kind="add_event", frame=3, event="cut_in", tracks=[track["id"]])
    act(kind="tag", first=3, last=3, tag="rain")
    act(kind="propose", first=0, last=5, **{"from": "run"})
    shown = engine.wait_for(lambda s: s.labels.task is not None and not s.labels.task.running, WAIT_S)
    proposed = [each for each in get("?since=0")["tracks"] if each["state"] == "proposed"]
    act(kind="accept", items=[{"kind": "track", "id": each["id"], "revision": each["revision"]} for each in proposed])
    assert client.post("/api/labels/versions", json={"name": "first", "person": "Ada"}).status_code == 201
    everything, window = get("?since=0"), get("/frames?first=3&last=3")
    state, score = shown.state_json()["labels"], get("/score")
    return {
        "LabelsState": state,
        "LabelTask": state["task"],
        "ActAnswer": added,
        "LabelsAnswer": added["changed"],
        "LabelTrack": track,
        "LabelOrigin": track["origin"],
        "LeadRange": everything["leads"][0],
        "PathLabel": everything["paths"][0],
        "EventLabel": everything["events"][0],
        "FrameTag": everything["tags"][0],
        "SightingsAnswer": window,
        "LabelSighting": window["sightings"]["3"][0],
        "Cuboid": window["sightings"]["3"][0]["cuboid"],
        "PastAct": get(f"/history?kind=track&id={track['id']}")[0],
        "Version": get("/versions")[0],
        "Score": score,
        "ScoreErrors": score["errors"][0],
        "Sizes": score["errors"][0]["distance"],
        "BadFrame": score["worst"][0],
        "Found": get("/next?what=unlabelled&frame=0"),
        "Still": get(f"/tracks/{track['id']}/filmstrip")[0],
        "Problem": get("/checks")["problems"][0],
        "LabelClass": get("/classes")["classes"][0],
        "AttributeKind": get("/classes")["attributes"][0],
    }


MADE_BY_THE_PAGE = {"Frame", "Series", "Drive"}
"""Types that the page builds from messages."""

ALL_TYPES = (
    JS / "core" / "types.js",
    JS / "drive" / "types.js",
    JS / "labeling" / "state" / "types.js",
    JS / "align" / "types.js",
)
KNOWN = {name: keys for file in ALL_TYPES for name, keys in typedefs(file.read_text(encoding="utf-8")).items()}


@pytest.mark.parametrize("name", sorted(KNOWN.keys() - MADE_BY_THE_PAGE))
def test_the_page_knows_every_key_and_no_other(sent: dict[str, Any], name: str):
    assert KNOWN[name] == set(sent[name]), (
        "say it in static/js/core/types.js, or its neighbour of drive/, labeling/ or align/"
    )


def test_every_kind_of_message_is_looked_at(sent: dict[str, Any]):
    assert set(sent) == KNOWN.keys() - MADE_BY_THE_PAGE


def test_every_gate_has_words_and_leads_to_a_parameter_that_there_is(sent: dict[str, Any]):
    words = (JS / "panels" / "gate_rows.js").read_text(encoding="utf-8")
    said = set(re.findall(r"^  (\w+): \{ label:", words, re.MULTILINE))
    assert {gate["name"] for item in sent["Result"]["objects"] for gate in item["gates"]} <= said
    assert set(re.findall(r'param: "([\w.]+)"', words)) <= set(sent["ParamsAnswer"]["values"])
