"""Labels over HTTP, as the page uses them: one person, two people, two servers of one team."""

from __future__ import annotations

import io
import itertools
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from http.client import HTTPConnection
from typing import Any
from uuid import UUID

import httpx
import pytest

from app.engine import Engine
from app.labels.database import Database, DatabaseError
from app.labels.desk import LabelDesk
from app.labels.log import Log
from app.limits import LARGEST_FILE
from app.routes.label_shapes import LabelsOfPerson, ScoreJson, Window
from app.server import create_app
from app.snapshot import Snapshot
from app.tokens import Tokens
from pipeline.labels.formats.native import from_json
from pipeline.params import Params
from pipeline.sources.base import TruthObject
from tests.app.recording import CountingDetector, Recording, opener
from tests.app.serving import WAIT_S, serving

COUNT = 30
TOKENS = Tokens("a" * 20, "b" * 20)


class Labelled(Recording):
    """The car is labelled too, 0.2 m nearer than it is, in the first twenty frames."""

    def truth(self, index: int) -> tuple[TruthObject, ...] | None:
        from pipeline.geometry import Cuboid

        if index >= 20:
            return None
        return (TruthObject("Car", Cuboid((30.0 - 0.4 * index + 1.8, 0.0, 0.1), (4.0, 1.6, 1.4), 0.0), 3),)


@contextmanager
def team(database: Database | None = None) -> Iterator[tuple[Engine, httpx.Client]]:
    """A server on a recording whose whole drive is computed."""
    recording = Labelled()
    desk = LabelDesk(database)
    engine = Engine(
        opener(recording), lambda _: CountingDetector(), Params(), uri=recording.uri, whole_drives=True, labels=desk
    )
    engine.start()
    try:
        engine.wait_for(lambda s: s.drive.run is not None and s.drive.phase == "done" and s.labels.labelled, WAIT_S)
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            yield engine, client
    finally:
        engine.stop()


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[Engine, httpx.Client]]:
    with team() as both:
        yield both


@pytest.fixture
def engine(server: tuple[Engine, httpx.Client]) -> Engine:
    return server[0]


@pytest.fixture
def client(server: tuple[Engine, httpx.Client]) -> httpx.Client:
    """Nothing is labelled at the start of each test."""
    found = server[1]
    there = found.get("/api/labels").json()
    items = [
        {"kind": kind, "id": each["id"], "revision": each["revision"]}
        for kind in ("track", "lead", "path", "event", "tag")
        for each in there[f"{kind}s"]
    ]
    if items:
        assert found.post(
            "/api/labels/act", json={"person": "broom", "act": {"kind": "remove", "items": items}}
        ).is_success
    return found


def act(client: httpx.Client, person: str = "Ada", **body: Any) -> httpx.Response:
    return client.post("/api/labels/act", json={"person": person, "act": body})


def task(engine: Engine, begun: httpx.Response) -> str:
    """Wait for what was begun; what it says in the end."""
    assert begun.status_code == 202, begun.text

    def ended(shown: Snapshot) -> bool:
        now = shown.labels.task
        return now is not None and now.id == begun.json()["task"] and not now.running

    state = engine.wait_for(ended, WAIT_S).labels.task
    assert state is not None
    return state.error or state.note


def proposed(engine: Engine, client: httpx.Client) -> dict[str, Any]:
    """The one track that the pipeline proposes."""
    task(engine, act(client, kind="propose", **{"from": "run"}))
    (track,) = labels(client)["tracks"]
    return track


def labels(client: httpx.Client, since: int = 0, person: str = "") -> dict[str, Any]:
    answer = client.get("/api/labels", params={"since": since, "person": person}).json()
    LabelsOfPerson.model_validate(answer)
    return answer


def ref(track: dict[str, Any]) -> dict[str, Any]:
    return {"kind": "track", "id": track["id"], "revision": track["revision"]}


CUBOID = {"center": [25.0, 1.0, 0.5], "size": [4.0, 1.8, 1.5], "yaw_rad": 0.1}

# ------------------------------------------------------------ one person


def test_the_pipelines_opinion_is_proposed_accepted_and_scored(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    assert (track["label"], track["state"], track["first"], track["last"]) == ("car", "proposed", 0, COUNT - 1)
    assert (track["keyframes"], track["sightings"], track["origin"]["maker"]) == ([], COUNT, "pipeline")
    assert track["origin"]["params"]
    assert track["origin"]["calibration"]
    (lead,) = labels(client)["leads"]
    assert (lead["lead"], lead["last"], lead["state"]) == (track["id"], COUNT - 1, "proposed")
    score = client.get("/api/labels/score").json()
    assert (score["judged"], score["metrics"]) == (0, [])
    items = [ref(track), {"kind": "lead", "id": lead["id"], "revision": lead["revision"]}]
    assert act(client, kind="accept", items=items).json()["what"] == f"accepted #{track['id']}, lead {lead['id']}"
    score = ScoreJson.model_validate(client.get("/api/labels/score").json())
    named = {metric.name: metric.run for metric in score.metrics}
    assert score.judged == COUNT - lead["first"]
    assert (named["CIPV correct"], named["switches"], named["HOTA"] or 0.0) == (
        100.0,
        0.0,
        pytest.approx(100.0, abs=2.0),
    )
    compared = client.get("/api/compare").json()
    assert (compared["truth"], compared["judged"]) == ("labels", score.judged)


def test_what_a_person_has_looked_at_is_not_proposed_again(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    act(client, kind="reject", items=[ref(track)])
    assert task(engine, act(client, kind="propose")).endswith("1 more are labelled already")
    (again,) = labels(client)["tracks"]
    assert (again["id"], again["state"]) == (track["id"], "rejected")


def test_a_proposal_that_nobody_looked_at_is_replaced_under_its_number(engine: Engine, client: httpx.Client) -> None:
    first, second = proposed(engine, client), proposed(engine, client)
    assert first["id"] == second["id"]
    assert len(client.get(f"/api/labels/tracks/{first['id']}").json()["sightings"]) == COUNT


def test_an_edit_shows_in_changes_window_track_and_history(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    before = labels(client)["revision"]
    body = {"kind": "set_sighting", "track": track["id"], "revision": track["revision"], "frame": 5, "cuboid": CUBOID}
    done = act(client, **body).json()
    (changed,) = done["changed"]["tracks"]
    assert (changed["id"], changed["keyframes"], changed["state"]) == (track["id"], [5], "corrected")
    assert labels(client, since=before)["tracks"] == [changed]
    window = Window.model_validate(client.get("/api/labels/frames", params={"first": 5, "last": 6}).json())
    assert [each.keyframe for each in (*window.sightings[5], *window.sightings[6])] == [True, False]
    assert client.get("/api/labels/frames?first=5&last=5").json()["sightings"]["5"][0]["cuboid"] == CUBOID
    newest = client.get("/api/labels/history", params={"kind": "track", "id": track["id"]}).json()[0]
    assert (newest["act"], newest["person"], newest["undone"]) == (done["act"], "Ada", False)
    assert newest["before"]["state"] == "proposed"
    assert [each["cuboid"] for each in newest["after"]["sightings"] if each["frame"] == 5] == [CUBOID]


def test_one_undo_goes_across_labels_parameters_and_calibration(engine: Engine, client: httpx.Client) -> None:
    act(client, kind="tag", frame=3, tag="night")
    for name, value in (("cipv.confirm_hits", 5), ("alignment.yaw_deg", 0.5)):
        client.patch("/api/params", json={"changes": {name: value}, "person": "Ada"})
    act(client, kind="tag", frame=4, tag="rain")
    undone = []
    for _ in range(4):
        undone.append(client.post("/api/labels/undo", json={"person": "Ada"}).json()["what"])
    assert undone == [
        "tagged frame 4 rain", "alignment.yaw_deg 0 → 0.5", "cipv.confirm_hits 3 → 5", "tagged frame 3 night",
    ]  # fmt: skip
    assert engine.control.peek().params == Params()
    assert labels(client, person="Ada")["can_redo"]
    for _ in range(4):
        assert client.post("/api/labels/redo", json={"person": "Ada"}).status_code == 200
    assert (engine.control.peek().params.cipv.confirm_hits, len(labels(client)["tags"])) == (5, 2)
    assert engine.control.peek().params.alignment.yaw_deg == 0.5
    for _ in range(3):
        client.post("/api/labels/undo", json={"person": "Ada"})


def test_a_slider_that_is_only_tried_is_undone_first(engine: Engine, client: httpx.Client) -> None:
    act(client, kind="tag", frame=3, tag="night")
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 9}, "final": False})
    assert client.post("/api/labels/undo", json={"person": "Ada"}).json()["what"] == "what was being tried"
    assert engine.control.peek().params.cipv.confirm_hits == 3
    assert len(labels(client)["tags"]) == 1


def test_the_cuboid_is_laid_on_the_points_and_a_car_lifted_out_of_the_picture(
    engine: Engine, client: httpx.Client
) -> None:
    lifted = act(client, kind="lift", frame=10, pixel=[160, 92], label="car").json()
    assert lifted["note"].startswith("laid on the")
    (track,) = labels(client)["tracks"]
    (placed,) = client.get(f"/api/labels/tracks/{track['id']}").json()["sightings"]
    assert placed["cuboid"]["center"][0] - placed["cuboid"]["size"][0] / 2 == pytest.approx(26.0, abs=0.1)
    off = placed["cuboid"] | {"center": [placed["cuboid"]["center"][0] + 0.4, 0.3, 0.5]}
    moved = act(
        client, kind="set_sighting", track=track["id"], revision=track["revision"], frame=10, cuboid=off
    ).json()["changed"]["tracks"][0]
    fitted = act(client, kind="refit", track=track["id"], revision=moved["revision"], frame=10).json()
    assert "points" in fitted["note"]
    near = client.get("/api/labels/frames?first=10&last=10").json()["sightings"]["10"][0]["cuboid"]
    assert near["center"][0] - near["size"][0] / 2 == pytest.approx(26.0, abs=0.1)
    nothing = act(client, kind="lift", frame=10, pixel=[3, 3])
    assert (nothing.status_code, "draw a box" in nothing.json()["detail"]) == (409, True)


def test_truth_is_imported_and_points_out_where_the_pipeline_says_otherwise(
    engine: Engine, client: httpx.Client
) -> None:
    assert "10 of 30 frames are not labelled" in task(engine, act(client, kind="import", what="truth"))
    (track,) = labels(client)["tracks"]
    assert (track["state"], track["sightings"], track["origin"]["maker"]) == ("accepted", 20, "import")
    act(client, kind="set_lead", first=0, last=9, lead=track["id"])
    act(client, kind="set_lead", first=10, last=12, lead="none")
    following = client.get("/api/labels/next", params={"what": "disagreement", "frame": 5}).json()
    assert following["frame"] == 10
    assert following["why"].endswith("the labels say none")
    assert client.get("/api/labels/next", params={"what": "unlabelled", "frame": 5}).json()["frame"] == 13
    assert client.get("/api/labels/next", params={"what": "proposed", "frame": 5}).json() == {
        "frame": None,
        "why": "no proposal is waiting there",
    }
    track = labels(client)["tracks"][0]
    act(client, "Bob", kind="send_back", items=[ref(track)], comment="too low")
    back = client.get("/api/labels/next", params={"what": "sent_back", "frame": 5, "direction": -1}).json()
    assert back == {"frame": 0, "why": f"#{track['id']}: too low"}


def test_what_is_there_already_is_not_imported_twice(engine: Engine, client: httpx.Client) -> None:
    for said in ("imported 1 tracks", "1 tracks are there already, place for place"):
        assert said in task(engine, act(client, kind="import", what="truth"))
    assert len(labels(client)["tracks"]) == 1


# ------------------------------------------------------------ files


@pytest.mark.parametrize("name", ["native", "openlabel", "kitti-tracking"])
def test_what_is_exported_can_be_imported(engine: Engine, client: httpx.Client, name: str) -> None:
    task(engine, act(client, kind="import", what="truth"))
    before = client.get(f"/api/labels/tracks/{labels(client)['tracks'][0]['id']}").json()
    answer = client.get("/api/labels/export", params={"format": name})
    assert answer.headers["content-disposition"].startswith(f'attachment; filename="labels-{name}.')
    lost = client.get("/api/labels/export/notes", params={"format": name}).json()["lost"]
    assert (answer.headers["x-cipv-lost"] == "0") == (lost == [])
    act(client, kind="remove", items=[ref(labels(client)["tracks"][0])])
    done = task(
        engine, client.post("/api/labels/import", params={"format": name, "person": "Bob"}, content=answer.content)
    )
    assert done.startswith("imported 1 tracks")
    after = client.get(f"/api/labels/tracks/{labels(client)['tracks'][0]['id']}").json()
    for one, other in zip(before["sightings"], after["sightings"], strict=True):
        assert one["frame"] == other["frame"]
        assert one["cuboid"]["center"] == pytest.approx(other["cuboid"]["center"], abs=0.01)
    assert client.post("/api/labels/undo", json={"person": "Bob"}).json()["what"].startswith("imported")
    assert labels(client)["tracks"] == []


def packed(**files: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        for name, text in files.items():
            made.writestr(name.replace("__", "/"), text)
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "body", "says"),
    [
        ("native", b"these are no labels", "the file: no JSON"),
        ("kitti", b"these are no labels", "no .zip of a folder"),
        ("kitti", packed(**{"..__..__out.txt": "x"}), "leads out of it"),
        ("openlabel", b"{}", "the file: "),
    ],
)
def test_a_file_that_is_none_is_said_and_changes_nothing(
    engine: Engine, client: httpx.Client, name: str, body: bytes, says: str
) -> None:
    before = labels(client)["revision"]
    answer = client.post("/api/labels/import", params={"format": name, "person": "Bob"}, content=body)
    assert says in task(engine, answer)
    assert labels(client)["revision"] == before


def test_a_version_is_frozen_and_given_out(engine: Engine, client: httpx.Client) -> None:
    act(client, kind="tag", frame=3, tag="night")
    names = [each["name"] for each in client.get("/api/labels/versions").json()]
    name = f"v{len(names) + 1}"
    assert client.post("/api/labels/versions", json={"name": name, "person": "Ada"}).status_code == 201
    assert client.post("/api/labels/versions", json={"name": name, "person": "Ada"}).status_code == 409
    found = from_json(client.get(f"/api/labels/versions/{name}").content, "version")
    assert (found.name, [each.tag for each in found.tags]) == (name, ["night"])
    assert (
        client.get("/api/labels/export", params={"version": name}).content
        == client.get(f"/api/labels/versions/{name}").content
    )
    for bad in ("../../etc/passwd", "", "x" * 100):
        assert client.post("/api/labels/versions", json={"name": bad, "person": "Ada"}).status_code == 422
    assert client.get("/api/labels/versions/nobody").status_code == 404


def test_a_name_is_the_same_however_it_is_spaced(client: httpx.Client) -> None:
    spaced = " Ada  Lovelace "
    assert act(client, spaced, kind="tag", frame=3, tag="night").is_success
    assert labels(client, person=spaced)["can_undo"]
    assert client.post("/api/labels/undo", json={"person": spaced}).json()["what"].endswith("night")
    change = {"changes": {"cipv.confirm_hits": 5}, "person": spaced}
    assert client.patch("/api/params", json=change).is_success
    assert client.post("/api/labels/undo", json={"person": "Ada Lovelace"}).is_success
    assert client.get("/api/params").json()["values"]["cipv.confirm_hits"] == 3


@pytest.mark.parametrize(
    ("method", "path", "status"),
    [
        ("GET", "/api/labels/tracks/77", 404),
        ("GET", "/api/labels/tracks/x", 422),
        ("GET", f"/api/labels/tracks/{2**63}", 422),
        ("GET", f"/api/labels/frames?first={2**63}&last={2**63}", 422),
        ("GET", f"/api/labels/next?what=unlabelled&frame={2**63}", 422),
        ("GET", f"/api/labels?since={2**63}", 422),
        ("GET", "/api/labels/frames?first=0&last=200", 422),
        ("GET", "/api/labels/frames?first=3&last=2", 422),
        ("GET", "/api/labels?since=-1", 422),
        ("GET", "/api/labels/export?format=nothing", 422),
        ("GET", "/api/labels/history?kind=param&id=1", 422),
        ("POST", "/api/labels/undo", 422),
        ("POST", "/api/labels/import?format=native", 422),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_sentence(
    client: httpx.Client, method: str, path: str, status: int
) -> None:
    answer = client.request(method, path)
    assert answer.status_code == status
    assert isinstance(answer.json()["detail"], str)


def test_a_file_beyond_all_measure_is_not_read(client: httpx.Client) -> None:
    connection = HTTPConnection(client.base_url.host, client.base_url.port or 0, timeout=WAIT_S)
    connection.putrequest("POST", "/api/labels/import?format=native&person=Ada")
    connection.putheader("content-length", str(LARGEST_FILE + 1))
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()


def test_the_display_in_the_car_may_look_and_not_touch(engine: Engine) -> None:
    with serving(create_app(engine, tokens=TOKENS)) as address:
        headers = {"authorization": f"Bearer {TOKENS.display}"}
        with httpx.Client(base_url=address, timeout=WAIT_S, headers=headers) as display:
            assert display.get("/api/labels").status_code == 200
            for path in ("act", "undo", "redo", "import", "versions"):
                assert display.post(f"/api/labels/{path}").status_code == 403


# ------------------------------------------------------------ what is sent


def test_what_is_sent_again_is_answered_as_before_and_done_once(engine: Engine, client: httpx.Client) -> None:
    def sent(path: str, person: str = "Ada", **more: Any) -> httpx.Response:
        return client.post(f"/api/labels/{path}", json={"person": person, "act_id": str(UUID(int=number))} | more)

    numbers = itertools.count(1)
    acts: tuple[tuple[str, dict[str, Any]], ...] = (
        ("act", {"act": {"kind": "tag", "frame": 3, "tag": "night"}}),
        ("act", {"act": {"kind": "lift", "frame": 10, "pixel": [160, 92]}}),
        ("undo", {}),
        ("redo", {}),
    )
    for path, body in acts:
        number = next(numbers)
        first, again = (sent(path, **body).json() for _ in range(2))
        assert first["act"] is not None
        assert again == first
        assert sent(path, "Bob", **body).json() == {"detail": "an act of somebody else has that id"}
    there = labels(client)
    assert (len(there["tags"]), len(there["tracks"])) == (1, 1)
    number = next(numbers)
    first, again = (sent("act", act={"kind": "propose"}).json()["task"] for _ in range(2))
    assert first == again
    engine.wait_for(lambda shown: shown.labels.task is not None and not shown.labels.task.running, WAIT_S)
    number = next(numbers)
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 9}, "final": False})
    assert [sent("undo").json()["what"] for _ in range(2)] == ["what was being tried"] * 2


def test_what_was_meant_for_another_recording_is_not_done_to_this_one(client: httpx.Client) -> None:
    drive = labels(client)["drive"]["id"]
    tag = {"kind": "tag", "frame": 3, "tag": "night"}
    assert client.post("/api/labels/act", json={"person": "Ada", "act": tag, "drive": drive}).status_code == 200
    before = labels(client)["revision"]
    for path, body in (("act", {"act": tag}), ("act", {"act": {"kind": "propose"}}), ("undo", {}), ("redo", {})):
        answer = client.post(f"/api/labels/{path}", json={"person": "Ada", "drive": "another"} | body)
        assert (answer.status_code, answer.json()["detail"]) == (409, "another recording is open now")
    handed = client.post("/api/labels/import", params={"person": "Ada", "drive": "another"}, content=b"{}")
    assert (handed.status_code, handed.json()["detail"]) == (409, "another recording is open now")
    assert labels(client)["revision"] == before


def test_an_act_is_answered_from_the_recording_that_it_was_done_to(
    engine: Engine, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Something else is opened between the commit and the answer."""
    opened = engine.labels._open
    do = Log.act

    def act_and_close(self: Log, *args: Any, **more: Any) -> Any:
        done = do(self, *args, **more)
        engine.labels.open("another", None)
        return done

    monkeypatch.setattr(Log, "act", act_and_close)
    try:
        answer = act(client, kind="tag", frame=3, tag="night")
    finally:
        engine.labels.open(opened.uri, opened.recording)
    assert (answer.status_code, len(answer.json()["changed"]["tags"])) == (200, 1)


# ------------------------------------------------------------ two people


def test_a_conflict_shows_both_and_loses_neither(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    mine = {"kind": "relabel", "track": track["id"], "revision": track["revision"], "label": "bus"}
    theirs = act(client, "Bob", **(mine | {"label": "truck"})).json()["changed"]["tracks"][0]
    refused = act(client, **mine)
    assert refused.status_code == 409
    assert refused.json()["detail"] == f"Bob changed #{track['id']} since"
    assert refused.json()["theirs"]["label"] == "truck"
    assert refused.json()["item"] == {"kind": "track", "id": mine["track"]}
    assert refused.json()["yours"] == mine
    assert act(client, **(mine | {"revision": theirs["revision"]})).status_code == 200
    history = client.get("/api/labels/history", params={"kind": "track", "id": track["id"]}).json()
    assert [entry["after"]["label"] for entry in history[:2]] == ["bus", "truck"]
    undo = client.post("/api/labels/undo", json={"person": "Bob"})
    assert (undo.status_code, "Ada changed" in undo.json()["detail"]) == (409, True)


def test_two_servers_of_a_team_see_each_others_acts(postgres_url: str) -> None:
    with ExitStack() as stack:
        first, ada = stack.enter_context(team(Database(postgres_url)))
        second, bob = stack.enter_context(team(Database(postgres_url)))
        done = act(ada, kind="tag", frame=3, tag="night").json()
        second.wait_for(lambda shown: shown.labels.revision == done["revision"], WAIT_S)
        (tag,) = labels(bob)["tags"]
        act(bob, "Bob", kind="remove", items=[{"kind": "tag", "id": tag["id"], "revision": tag["revision"]}])
        first.wait_for(lambda shown: shown.labels.revision == done["revision"] + 1, WAIT_S)
        assert labels(ada, since=done["revision"])["removed"] == [{"kind": "tag", "id": tag["id"]}]


def test_after_a_restart_everything_is_there_and_can_be_undone(tmp_path: Any) -> None:
    file = tmp_path / "labels.db"
    with team(Database.in_file(file)) as (_, client):
        act(client, kind="tag", frame=3, tag="night")
        client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 5}, "person": "Ada"})
    with team(Database.in_file(file)) as (_, client):
        assert len(labels(client)["tags"]) == 1
        assert labels(client, person="Ada")["can_undo"]
        undone = [client.post("/api/labels/undo", json={"person": "Ada"}).json()["what"] for _ in range(2)]
        assert undone == ["cipv.confirm_hits 3 → 5", "tagged frame 3 night"]
        assert client.post("/api/labels/undo", json={"person": "Ada"}).status_code == 409
        assert labels(client)["tags"] == []


def test_a_database_that_fails_keeps_nobody_from_driving(
    engine: Engine, client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    def away(_: Database) -> None:
        raise DatabaseError("labels: the server is away")

    with monkeypatch.context() as patched:
        patched.setattr(Database, "writing", away)
        assert client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 6}}).status_code == 200
        assert engine.control.peek().params.cipv.confirm_hits == 6
        for refused in (
            act(client, kind="tag", frame=1, tag="x"),
            client.post("/api/labels/undo", json={"person": "A"}),
        ):
            assert (refused.status_code, refused.json()["detail"]) == (503, "labels: the server is away")
        patched.setattr(Database, "reading", away)
        assert client.get("/api/compare").status_code == 200
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 3}})
    assert act(client, kind="tag", frame=1, tag="x").status_code == 200


def test_live_sensors_and_nothing_cannot_be_labelled() -> None:
    engine = Engine(opener(Recording()), None, Params())
    engine.start()
    try:
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            assert client.get("/api/state").json()["labels"] is None
            answer = act(client, kind="tag", frame=0, tag="x")
            assert answer.json()["detail"] == "no recording is open that could be labelled"
            assert answer.status_code == 404
    finally:
        engine.stop()
