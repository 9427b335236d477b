"""Labels that come and go as files, over HTTP: truth, other tools' formats, frozen versions."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from dataclasses import replace
from http.client import HTTPConnection

import httpx
import pytest

from app.engine.engine import Engine
from app.labels.transfer import files
from app.web.guards.limits import LARGEST_FILE
from pipeline.common.progress import Progress
from pipeline.labels.formats.base import LabeledDrive, drive_of
from pipeline.labels.formats.native import from_json
from pipeline.labels.formats.registry import FORMATS
from pipeline.types import Frame
from pipeline.types.source import Source
from tests.app.labels.site import act, drive, labels, move, ref, task
from tests.app.web.serving import WAIT_S


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
        "why": "no proposals there",
        "item": None,
        "left": 0,
    }
    track = labels(client)["tracks"][0]
    act(client, "Bob", kind="send_back", items=[ref(track)], comment="too low")
    back = client.get("/api/labels/next", params={"what": "sent_back", "frame": 5, "direction": -1}).json()
    item = {"kind": "track", "id": track["id"]}
    assert back == {"frame": 0, "why": f"#{track['id']}: too low", "item": item, "left": 1}


def test_what_is_there_already_is_not_imported_twice(engine: Engine, client: httpx.Client) -> None:
    for said in ("imported 1 tracks", "1 tracks are already here, identical in every frame"):
        assert said in task(engine, act(client, kind="import", what="truth"))
    assert len(labels(client)["tracks"]) == 1


def test_a_drive_is_looked_through_once_while_it_is_open(client: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []

    def look(source: Source, progress: Progress, frame_of: Callable[[int], Frame]) -> LabeledDrive:
        looked.append(source.uri)
        return drive_of(source, progress, frame_of)

    monkeypatch.setattr(files, "drive_of", look)
    answers = [client.get("/api/labels/export", params={"format": name}) for name in ("native", "coco", "native")]
    assert [answer.status_code for answer in answers] == [200] * 3
    assert answers[0].content == answers[2].content
    assert len(looked) == 1


def test_every_format_is_listed_with_what_the_page_says_of_it(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    added = replace(FORMATS["csv"], name="names", title="Names", about="what there is")
    monkeypatch.setitem(FORMATS, "names", added)
    listed = client.get("/api/labels/formats").json()
    assert [each["name"] for each in listed] == list(FORMATS)
    assert listed[0] == {"name": "native", "title": "CIPV Studio", "about": "all labels"}
    assert listed[-1] == {"name": "names", "title": "Names", "about": "what there is"}


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
        engine,
        client.post(
            "/api/labels/import",
            params={"format": name, "person": "Bob", "drive": drive(client)},
            content=answer.content,
        ),
    )
    assert done.startswith("imported 1 tracks")
    after = client.get(f"/api/labels/tracks/{labels(client)['tracks'][0]['id']}").json()
    for one, other in zip(before["sightings"], after["sightings"], strict=True):
        assert one["frame"] == other["frame"]
        assert one["cuboid"]["center"] == pytest.approx(other["cuboid"]["center"], abs=0.01)
    assert move(client, "undo", "Bob").json()["what"].startswith("imported")
    assert labels(client)["tracks"] == []


def packed(method: int = zipfile.ZIP_DEFLATED, **files: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as made:
        for name, text in files.items():
            # With a fixed date: the bytes are part of tests' names, which must be the same in every process
            made.writestr(zipfile.ZipInfo(name.replace("__", "/")), text, method)
    return out.getvalue()


def spoilt(at: int, in_directory: int | None, value: int, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A .zip of one file in which byte ``at`` of the header is changed, here and in the directory at the end."""
    body = bytearray(packed(method, **{"a.txt": "x"}))
    body[at] = value
    if in_directory is not None:
        body[body.index(b"PK\x01\x02") + in_directory] = value
    return bytes(body)


def nameless() -> bytes:
    """A .zip of one file without a name."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as made:
        made.writestr(zipfile.ZipInfo(""), "x")
    return out.getvalue()


FLAGS, METHOD, DATA = (6, 8), (8, 10), 30 + len("a.txt")
"""Offsets in the header before the file, and in the directory at the end (PKWARE's APPNOTE, 4.3.7 and 4.3.12)."""


@pytest.mark.parametrize(
    ("name", "body", "says"),
    [
        ("native", b"these are no labels", "the file: not JSON"),
        ("kitti", b"these are no labels", "not a valid .zip"),
        ("kitti", packed(**{"..__..__out.txt": "x"}), "path outside its folder"),
        ("kitti", spoilt(*FLAGS, 1), "the .zip needs a password"),
        ("kitti", spoilt(*METHOD, 99), "not packed with deflate"),
        ("kitti", nameless(), "a file without a name"),
        ("kitti", spoilt(DATA, None, 0xFF), "Error -3 while decompressing data"),
        ("kitti", packed(zipfile.ZIP_LZMA, **{"a.txt": "x"}), "not packed with deflate"),
        ("openlabel", b"{}", "the file: "),
    ],
)
def test_a_file_that_is_none_is_said_and_changes_nothing(
    engine: Engine, client: httpx.Client, name: str, body: bytes, says: str
) -> None:
    before = labels(client)["revision"]
    asked = {"format": name, "person": "Bob", "drive": drive(client)}
    answer = client.post("/api/labels/import", params=asked, content=body)
    assert says in task(engine, answer)
    assert labels(client)["revision"] == before


def test_a_version_is_frozen_and_given_out(engine: Engine, client: httpx.Client) -> None:
    act(client, kind="tag", first=3, last=3, tag="night")
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


def test_two_versions_are_compared(client: httpx.Client) -> None:
    act(client, kind="set_lead", first=3, last=6, lead="none")
    assert client.post("/api/labels/versions", json={"name": "one", "person": "Ada"}).status_code == 201
    act(client, kind="set_lead", first=5, last=6, lead="unknown")
    found = client.get("/api/labels/agreement", params={"first": "one"}).json()
    assert (found["lead_share"], found["lead_disagreements"]) == (0.5, [5, 6])
    same = client.get("/api/labels/agreement", params={"first": "one", "second": "one"}).json()
    assert (same["lead_share"], same["lead_disagreements"]) == (1.0, [])
    assert client.get("/api/labels/agreement", params={"first": "nobody"}).status_code == 404
    act(client, kind="clear_lead", first=3, last=6)


def test_a_file_beyond_all_measure_is_not_read(client: httpx.Client) -> None:
    connection = HTTPConnection(client.base_url.host, client.base_url.port or 0, timeout=WAIT_S)
    connection.putrequest("POST", "/api/labels/import?format=native&person=Ada&drive=x")
    connection.putheader("content-length", str(LARGEST_FILE + 1))
    connection.endheaders()
    assert connection.getresponse().status == 413
    connection.close()
