"""Labels over HTTP, as the page of one person uses them."""

from __future__ import annotations

import httpx
import pytest

from app.engine.engine import Engine
from app.web.guards.tokens import Tokens
from app.web.routes.labels.score_shapes import ScoreJson
from app.web.routes.labels.sighting_shapes import Window
from app.web.server import create_app
from pipeline.labels.model import WHOLE_TAG
from pipeline.params import Params
from tests.app.engine.recording_helpers import Recording, opener
from tests.app.labels.site import COUNT, CUBOID, act, labels, move, proposed, ref, task
from tests.app.web.serving import WAIT_S, serving

TOKENS = Tokens("a" * 20, "b" * 20)


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
    said = f"accepted #{track['id']}, lead #{track['id']} in frames 1–30"
    assert act(client, kind="accept", items=items).json()["what"] == said
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


def test_a_lead_whose_track_is_only_proposed_judges_nothing_and_it_is_said(
    engine: Engine, client: httpx.Client
) -> None:
    """Nor do labels of a frame that may contain other vehicles: no detection there counts as false."""
    track = proposed(engine, client)
    (lead,) = labels(client)["leads"]
    done = act(client, kind="accept", items=[{"kind": "lead", "id": lead["id"], "revision": lead["revision"]}]).json()
    assert done["what"].endswith(f"; #{track['id']} is still proposed")
    score = ScoreJson.model_validate(client.get("/api/labels/score").json())
    said = f"#{track['id']} leads in 30 frames but is only proposed: not scored until accepted."
    assert (score.judged, score.metrics, score.errors, score.notes[0]) == (0, [], [], said)
    following = client.get("/api/labels/next", params={"what": "disagreement", "frame": 0}).json()
    assert (following["frame"], following["why"]) == (None, f"no frame is scored: {said}")
    compared = client.get("/api/compare").json()
    assert (compared["truth"], compared["judged"]) == ("recording", 20), "the labels that come with it judge"


def test_a_wrong_lead_is_among_the_worst_frames(engine: Engine, client: httpx.Client) -> None:
    """A label drawn by hand one lane to the side; the rest of the frame is unlabelled."""
    beside = CUBOID | {"center": [CUBOID["center"][0], 3.5, CUBOID["center"][2]]}
    act(client, kind="add_track", label="car", frame=4, cuboid=beside, bbox=None)
    (track,) = labels(client)["tracks"]
    act(client, kind="set_lead", first=4, last=4, lead=track["id"])
    score = ScoreJson.model_validate(client.get("/api/labels/score").json())
    assert [(each.frame, each.verdict) for each in score.worst] == [(4, "wrong")]
    assert not {"precision", "MOTA"} & {metric.name for metric in score.metrics}
    assert any("in 0 of 1 labelled frames" in note for note in score.notes)
    act(client, kind="tag", first=4, last=4, tag=WHOLE_TAG, on=True)
    score = ScoreJson.model_validate(client.get("/api/labels/score").json())
    assert {"precision", "MOTA"} <= {metric.name for metric in score.metrics}


def test_what_a_person_has_looked_at_is_not_proposed_again(engine: Engine, client: httpx.Client) -> None:
    track = proposed(engine, client)
    act(client, kind="reject", items=[ref(track)])
    assert task(engine, act(client, kind="propose")).endswith("1 more are already labelled")
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
    act(client, kind="tag", first=3, last=3, tag="night")
    for name, value in (("cipv.confirm_hits", 5), ("alignment.yaw_deg", 0.5)):
        client.patch("/api/params", json={"changes": {name: value}, "person": "Ada"})
    act(client, kind="tag", first=4, last=4, tag="rain")
    undone = []
    for _ in range(4):
        undone.append(move(client, "undo", "Ada").json()["what"])
    assert undone == [
        "tagged frame 5 rain", "alignment.yaw_deg 0 → 0.5", "cipv.confirm_hits 3 → 5", "tagged frame 4 night",
    ]  # fmt: skip
    assert engine.control.peek().params == Params()
    assert labels(client, person="Ada")["can_redo"]
    for _ in range(4):
        assert move(client, "redo", "Ada").status_code == 200
    assert (engine.control.peek().params.cipv.confirm_hits, len(labels(client)["tags"])) == (5, 2)
    assert engine.control.peek().params.alignment.yaw_deg == 0.5
    for _ in range(3):
        move(client, "undo", "Ada")


def test_a_slider_that_is_only_tried_is_undone_first(engine: Engine, client: httpx.Client) -> None:
    act(client, kind="tag", first=3, last=3, tag="night")
    client.patch("/api/params", json={"changes": {"cipv.confirm_hits": 9}, "final": False})
    assert move(client, "undo", "Ada").json()["what"] == "the parameters being tried"
    assert engine.control.peek().params.cipv.confirm_hits == 3
    assert len(labels(client)["tags"]) == 1


def test_the_cuboid_is_laid_on_the_points_and_a_car_lifted_out_of_the_image(
    engine: Engine, client: httpx.Client
) -> None:
    lifted = act(client, kind="lift", frame=10, pixel=[160, 92], label="car").json()
    assert lifted["note"].startswith("fitted to the")
    (track,) = labels(client)["tracks"]
    assert (track["state"], track["origin"]["how"]) == ("proposed", lifted["note"]), "nobody has said that it is so"
    (past,) = client.get("/api/labels/history", params={"kind": "track", "id": track["id"]}).json()
    assert (past["what"], past["note"]) == (f"proposed #{track['id']}, a car, in frame 11", lifted["note"])
    (placed,) = client.get(f"/api/labels/tracks/{track['id']}").json()["sightings"]
    assert placed["cuboid"]["center"][0] - placed["cuboid"]["size"][0] / 2 == pytest.approx(26.0, abs=0.1)
    off = placed["cuboid"] | {"center": [placed["cuboid"]["center"][0] + 0.4, 0.3, 0.5]}
    moved = act(
        client, kind="set_sighting", track=track["id"], revision=track["revision"], frame=10, cuboid=off
    ).json()["changed"]["tracks"][0]
    assert labels(client)["tracks"][0]["origin"]["how"] == "", "it is where a person put it now"
    fitted = act(client, kind="refit", track=track["id"], revision=moved["revision"], frame=10).json()
    assert "points" in fitted["note"]
    near = client.get("/api/labels/frames?first=10&last=10").json()["sightings"]["10"][0]["cuboid"]
    assert near["center"][0] - near["size"][0] / 2 == pytest.approx(26.0, abs=0.1)
    far = act(client, kind="lift", frame=10, bbox=[20, 85, 40, 97], label="car").json()
    estimated = next(each for each in labels(client)["tracks"] if each["id"] != track["id"])
    assert "judging by its height in the image" in estimated["origin"]["how"] == far["note"]
    act(client, kind="relabel", track=estimated["id"], revision=estimated["revision"], label="truck")
    (estimated,) = (each for each in labels(client)["tracks"] if each["id"] == estimated["id"])
    assert (estimated["state"], estimated["label"], estimated["origin"]["how"]) == ("proposed", "truck", far["note"]), (
        "another class does not make the distance true"
    )
    act(client, kind="accept", items=[ref(estimated)])
    (accepted,) = (each for each in labels(client)["tracks"] if each["id"] == estimated["id"])
    assert (accepted["state"], accepted["origin"]["how"]) == ("accepted", far["note"]), "still an estimate"
    nothing = act(client, kind="lift", frame=10, pixel=[3, 3])
    assert (nothing.status_code, "draw a box" in nothing.json()["detail"]) == (409, True)


def test_a_track_is_carried_on_from_one_frame_by_one_act_and_taken_back_by_one(
    engine: Engine, client: httpx.Client
) -> None:
    act(client, kind="lift", frame=10, pixel=[160, 92], label="car")
    (track,) = labels(client)["tracks"]
    carried = act(client, kind="propagate", track=track["id"], revision=track["revision"])
    assert carried.is_success, carried.text
    (after,) = labels(client)["tracks"]
    assert (after["first"], after["last"], after["keyframes"]) == (0, COUNT - 1, [10])
    frames = client.get("/api/labels/frames?first=0&last=19").json()["sightings"]
    rear = [rows[0]["cuboid"]["center"][0] - rows[0]["cuboid"]["size"][0] / 2 for rows in frames.values()]
    assert rear == pytest.approx([30.0 - 0.4 * index for index in range(20)], abs=0.3)
    again = act(client, kind="propagate", track=after["id"], revision=after["revision"])
    assert (again.status_code, "before its first or after its last frame" in again.json()["detail"]) == (409, True)
    move(client, "undo", "Ada")
    (back,) = labels(client)["tracks"]
    assert (back["first"], back["last"]) == (10, 10)


def test_a_name_is_the_same_however_it_is_spaced(client: httpx.Client) -> None:
    spaced = " Ada  Lovelace "
    assert act(client, spaced, kind="tag", first=3, last=3, tag="night").is_success
    assert labels(client, person=spaced)["can_undo"]
    assert move(client, "undo", spaced).json()["what"].endswith("night")
    change = {"changes": {"cipv.confirm_hits": 5}, "person": spaced}
    assert client.patch("/api/params", json=change).is_success
    assert move(client, "undo", "Ada Lovelace").is_success
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
        ("POST", "/api/labels/import?person=Ada", 422),
    ],
)
def test_what_cannot_be_asked_is_refused_in_a_sentence(
    client: httpx.Client, method: str, path: str, status: int
) -> None:
    answer = client.request(method, path)
    assert answer.status_code == status
    assert isinstance(answer.json()["detail"], str)


def test_the_display_in_the_car_may_look_and_not_touch(engine: Engine) -> None:
    with serving(create_app(engine, tokens=TOKENS)) as address:
        headers = {"authorization": f"Bearer {TOKENS.display}"}
        with httpx.Client(base_url=address, timeout=WAIT_S, headers=headers) as display:
            assert display.get("/api/labels").status_code == 200
            for path in ("act", "undo", "redo", "import", "versions"):
                assert display.post(f"/api/labels/{path}").status_code == 403


def test_live_sensors_and_nothing_cannot_be_labelled() -> None:
    engine = Engine(opener(Recording()), None, Params())
    engine.start()
    try:
        with serving(create_app(engine)) as address, httpx.Client(base_url=address, timeout=WAIT_S) as client:
            assert client.get("/api/state").json()["labels"] is None
            answer = act(client, kind="tag", first=0, last=0, tag="x")
            assert answer.json()["detail"] == "no recording is open"
            assert answer.status_code == 404
    finally:
        engine.stop()
