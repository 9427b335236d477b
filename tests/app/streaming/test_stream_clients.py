"""The stream over real sockets: several clients at once, one of them slow, one that joins late."""

from __future__ import annotations

import json
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from starlette.applications import Starlette
from starlette.routing import WebSocketRoute
from websockets.sync.client import ClientConnection, connect

from app.core.detection_cache import DetectionCache
from app.core.server_address import listen_socket
from app.engine.page_frames import PageFrames
from app.engine.seekable_pipeline import SeekablePipeline
from app.engine.snapshot import Snapshot
from app.streaming.sent_image import MAX_WIDTH_PX
from app.streaming.slot import FRAMES_UNDER_WAY
from app.streaming.stream import Stream
from app.web.server import Server
from pipeline.common.geometry import Cuboid
from pipeline.detection import Detectors
from pipeline.params import Params, with_changes
from pipeline.recording.recording_state import RecordingState
from pipeline.types import CameraImage
from tests.app.engine.recording_helpers import CountingDetector, Recording

WAIT_S = 180.0
RECORDING = RecordingState(Path("a.mcap"), (Path("a.mcap"),), 1, 0.1, 9, 0, None)
FAST_FRAMES = 40
"""More than the system's buffers hold between a server and a client that does not read."""


@dataclass
class Site:
    """A server with only the stream; ``show(n)`` publishes frame n, as an engine's thread does."""

    stream: Stream
    port: int
    first: Snapshot
    pauses: list[bool] = field(default_factory=list)
    """One entry for each time that the stream paused playback."""

    def show(self, sequence: int, **changes: Any) -> None:
        self.stream.publish(replace(self.first, sequence=sequence, index=sequence, **changes))

    def connected(self, query: str = "") -> AbstractContextManager[ClientConnection]:
        """A client with a small receive buffer and a short closing timeout."""
        end = socket.socket()
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
        end.connect(("127.0.0.1", self.port))
        url = f"ws://127.0.0.1:{self.port}/{query}"
        patience = {"open_timeout": WAIT_S, "close_timeout": 0.5}
        return connect(url, sock=end, max_size=None, compression=None, max_queue=1, **patience)


@pytest.fixture
def site() -> Iterator[Site]:
    frames = PageFrames(nullcontext)
    frames.open(_pipeline())
    pauses: list[bool] = []
    stream = Stream(frames=frames, pause=lambda: pauses.append(True))
    bound, is_ready = listen_socket("127.0.0.1", 0), threading.Event()
    app = Starlette(routes=[WebSocketRoute("/", stream.serve)])
    server = Server(app, "http://ready", lambda _: is_ready.set())  # type: ignore[arg-type]
    thread = threading.Thread(target=lambda: server.run(sockets=[bound]))
    thread.start()
    assert is_ready.wait(WAIT_S)
    site = Site(stream, bound.getsockname()[1], _first(), pauses)
    site.show(0)
    yield site
    server.should_exit = True
    thread.join()


def _first() -> Snapshot:
    """A frame with a noise image wider than any page needs, whose JPEG is large."""
    pipeline = _pipeline()
    tick = pipeline.seek(0, Params())
    assert tick is not None
    noise = np.random.default_rng(0).integers(0, 255, (900, 2560, 3), np.uint8)
    tick = replace(tick, frame=replace(tick.frame, image=CameraImage(0, noise)))
    return Snapshot(Params(), uri=pipeline.source.uri, count=1, processed=tick)


def _pipeline() -> SeekablePipeline:
    return SeekablePipeline(Recording(), Detectors(CountingDetector(), None), DetectionCache(), "both")


def next_header(client: ClientConnection) -> dict[str, Any]:
    while True:
        message = client.recv(WAIT_S)
        if isinstance(message, bytes):
            (length,) = struct.unpack_from("<I", message)
            return json.loads(message[4 : 4 + length])


def header_where(client: ClientConnection, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    while not wanted(header := next_header(client)):
        pass
    return header


def sequence_of(header: dict[str, Any]) -> int:
    return int(header["state"]["sequence"])


def test_a_client_that_does_not_read_hurts_nobody_and_gets_the_newest_afterwards(site: Site):
    with site.connected() as slow, site.connected() as fast:
        assert sequence_of(next_header(fast)) == 0
        for number in range(1, FAST_FRAMES + 1):
            site.show(number)
            assert sequence_of(next_header(fast)) == number, "each one, at once"
        got = [sequence_of(next_header(slow))]
        while got[-1] != FAST_FRAMES:
            got.append(sequence_of(next_header(slow)))
    assert got == sorted(set(got))
    assert len(got) < FAST_FRAMES / 2, "what it had no time for was dropped, not kept for it"


def test_a_page_that_does_not_paint_is_sent_no_more_than_two_frames(site: Site):
    with site.connected("?paced=1") as page, site.connected() as other:
        assert sequence_of(next_header(page)) == sequence_of(next_header(other)) == 0
        for number in range(1, 8):
            site.show(number)
            assert sequence_of(next_header(other)) == number
        second = sequence_of(next_header(page))
        assert second < FRAMES_UNDER_WAY, "the next one went out before it was painted, no further one did"
        page.send(json.dumps({"painted": True}))
        assert sequence_of(next_header(page)) == 7, "then the newest"


def test_one_frame_is_encoded_once_for_all(site: Site, monkeypatch: pytest.MonkeyPatch):
    made: list[int] = []
    encode = site.stream._encoder.message
    monkeypatch.setattr(
        site.stream._encoder, "message", lambda shown, width: made.append(shown.sequence) or encode(shown, width)
    )
    with site.connected() as one, site.connected() as two, site.connected() as three:
        for client in (one, two, three):
            next_header(client)
        for number in range(1, 4):
            site.show(number)
            for client in (one, two, three):
                assert sequence_of(next_header(client)) == number
    assert [number for number in made if number > 0] == [1, 2, 3]


def test_who_joins_late_sees_the_present_frame_and_the_present_state(site: Site):
    site.show(5)
    site.show(5, playing=True)
    with site.connected() as late:
        assert sequence_of(next_header(late)) == 5
        state = json.loads(late.recv(WAIT_S))
    assert state["type"] == "state"
    assert state["state"]["playing"] is True, "also what came after the frame"


def test_the_image_is_as_wide_as_the_widest_page_shows_it(site: Site):
    """Also while paused; a page may state its width when it connects."""

    def width(header: dict[str, Any]) -> int:
        return int(header["picture"]["width"])

    with site.connected() as narrow:
        assert width(next_header(narrow)) == MAX_WIDTH_PX, "until it says what it needs"
        narrow.send(json.dumps({"picture_px": 500}))
        _heard(narrow)
        site.show(1)
        assert width(next_header(narrow)) == 640
        with site.connected() as wide:
            assert width(next_header(wide)) == MAX_WIDTH_PX
            wide.send(json.dumps({"picture_px": 1700}))
            assert width(header_where(wide, lambda header: width(header) > MAX_WIDTH_PX)) == 1760
            site.show(2)
            assert width(next_header(narrow)) == 1760
        assert any(width(shown_next(site, narrow, number)) == 640 for number in range(3, 100)), "the wide one has gone"
    with site.connected("?picture_px=300") as small:
        assert width(shown_next(site, small, 100)) == 320


def test_a_pause_is_heard_while_the_image_is_made_wider(site: Site, monkeypatch: pytest.MonkeyPatch):
    """The frame, which says that it is playing, arrives late; the page must ignore this."""
    encode, begun, gate = site.stream._encoder.message, threading.Event(), threading.Event()

    def slowly(snapshot: Snapshot, width_px: int) -> bytes | None:
        begun.set()
        assert gate.wait(WAIT_S)
        return encode(snapshot, width_px)

    site.show(1, playing=True)
    with site.connected() as client:
        assert next_header(client)["state"]["playing"] is True
        monkeypatch.setattr(site.stream._encoder, "message", slowly)
        client.send(json.dumps({"picture_px": 1700}))
        assert begun.wait(WAIT_S)
        pausing = threading.Thread(target=lambda: site.show(1, playing=False))
        pausing.start()
        gate.set()
        pausing.join()
        assert believed(client) is False


def believed(client: ClientConnection) -> bool:
    """Whether a page would show it as playing: the last message counts. Asked twice, because the first answer may
    precede a state in the same batch."""
    playing, answers = True, 0
    client.send(json.dumps({"ping": 1}))
    while answers < 2:
        message = client.recv(WAIT_S)
        if isinstance(message, bytes):
            (length,) = struct.unpack_from("<I", message)
            playing = json.loads(message[4 : 4 + length])["state"]["playing"]
        elif (said := json.loads(message))["type"] == "state":
            playing = said["state"]["playing"]
        elif said["type"] == "pong":
            answers += 1
            client.send(json.dumps({"ping": 1}))
    return playing


def shown_next(site: Site, client: ClientConnection, sequence: int) -> dict[str, Any]:
    """Publish a frame; returns what the client receives."""
    site.show(sequence)
    return header_where(client, lambda header: sequence_of(header) == sequence)


@pytest.mark.parametrize("said", ["1e9", "-3", "null", '"wide"', "NaN", "[]"])
def test_a_nonsense_width_changes_nothing(site: Site, said: str):
    with site.connected() as client:
        next_header(client)
        client.send(f'{{"picture_px": {said}}}')
        _heard(client)
        site.show(1)
        width = next_header(client)["picture"]["width"]
    assert width == MAX_WIDTH_PX


@pytest.mark.parametrize("said", ["²", "wide", "9" * 400, ""])
def test_a_nonsense_width_in_the_address_changes_nothing(site: Site, said: str):
    with site.connected(f"?picture_px={quote(said)}") as client:
        assert next_header(client)["picture"]["width"] == MAX_WIDTH_PX


CUBOID = {"center": [20, 0, 1], "size": [4, 2, 1.5], "yaw_rad": 0.5}
NAME, OTHER = "a" * 32, "b" * 32


def test_what_a_page_looks_at_is_heard_until_it_leaves(site: Site):
    looks = site.stream._looks
    label = {"track": 7, "cuboid": CUBOID, "text": "#7 car, accepted", "role": "fused", "facing": True}
    labels = {"labels": [label], "alone": True}
    with site.connected() as page:
        page.send(json.dumps({"page_3d": NAME, "selected": 7, "hides_3d": True, "labels_3d": labels}))
        _heard(page)
        view = looks.view_of_name(NAME)
        assert (view.selected, looks.hiding) == (7, 1)
        assert view.labels is not None
        assert [each.text for each in view.labels.labels] == ["#7 car, accepted"]
        for nonsense in ('{"selected": "7"}', '{"selected": -1}', '{"selected": 1e400}', '{"hides_3d": 2}'):
            page.send(nonsense)
        _heard(page)
        assert (looks.view_of_name(NAME).selected, looks.hiding) == (7, 1)
        page.send(json.dumps({"selected": None, "labels_3d": {**labels, "alone": 5}, "hides_3d": False}))
        _heard(page)
        assert (looks.view_of_name(NAME).selected, looks.view_of_name(NAME).labels) == (None, None)
        page.send(json.dumps({"labels_3d": labels}))
        _heard(page)
        assert looks.view_of_name(NAME).labels is not None
    with site.connected() as other:
        next_header(other)
        for _ in range(100):
            _heard(other)
            if looks.view_of_name(NAME).labels is None:
                break
    assert looks.view_of_name(NAME).labels is None


def test_a_label_that_is_held_in_3d_is_followed_by_its_page_alone(site: Site):
    looks = site.stream._looks
    with site.connected() as page, site.connected() as other:
        page.send(json.dumps({"page_3d": NAME, "held": {"track": 7, "frame": 3, "cuboid": CUBOID}}))
        _heard(page)
        held = looks.view_of_name(NAME).held
        assert held is not None
        assert (held.track, held.frame, held.cuboid) == (7, 3, Cuboid((20.0, 0.0, 1.0), (4.0, 2.0, 1.5), 0.5))
        other.send(json.dumps({"page_3d": OTHER, "held": {"track": 9, "frame": 3, "cuboid": CUBOID}}))
        _heard(other)
        looks.drag(replace(held, cuboid=held.cuboid._replace(yaw_rad=1.0)), True)
        said = {"type": "held", "track": 7, "frame": 3, "cuboid": CUBOID | {"yaw_rad": 1.0}, "ended": True}
        assert next(message for message in _texts(page) if message["type"] == "held") == said
        others = looks.view_of_name(OTHER).held
        assert (others and others.track) == 9, "the other's stays where it is"
        other.send(json.dumps({"held": None}))
        _heard(other)
        assert looks.view_of_name(OTHER).held is None
        assert looks.view_of_name(NAME).held is not None, "another page holds nothing of this one's"
        looks.pick(NAME, 4)
        assert next(message for message in _texts(page) if message["type"] == "selected")["id"] == 4
        assert looks.view_of_name(OTHER).selected is None
        for nonsense in ({"track": "7", "cuboid": 3}, {"track": 7, "cuboid": CUBOID}, 5):
            page.send(json.dumps({"held": nonsense}))
            _heard(page)
            assert looks.view_of_name(NAME).held is None
            page.send(json.dumps({"held": {"track": 7, "frame": 3, "cuboid": CUBOID}}))
        _heard(page)
        assert looks.view_of_name(NAME).held is not None


def _texts(client: ClientConnection) -> Iterator[dict[str, Any]]:
    while True:
        if isinstance(message := client.recv(WAIT_S), str):
            yield json.loads(message)


def _heard(client: ClientConnection) -> None:
    """Wait until the server has read everything sent so far."""
    client.send(json.dumps({"ping": 1}))
    while isinstance(message := client.recv(WAIT_S), bytes) or json.loads(message)["type"] != "pong":
        pass


def index_of(header: dict[str, Any]) -> int:
    return int(header["state"]["index"])


def test_a_page_with_its_own_playhead_is_moved_by_nobody_and_moves_nobody(site: Site):
    with site.connected() as own, site.connected() as other:
        next_header(own)
        own.send(json.dumps({"own": 3}))
        mine = header_where(own, lambda header: index_of(header) == 3)
        assert mine["result"]["frame"] != site.first.processed.result.frame  # type: ignore[union-attr]
        site.show(5, playing=True)
        assert index_of(header_where(other, lambda header: sequence_of(header) == 5)) == 5
        own.send(json.dumps({"own": 2}))
        came = [next_header(own)]
        while index_of(came[-1]) == 3:  # its own frame again, since the state of the others has changed
            came.append(next_header(own))
        assert index_of(came[-1]) == 2, "what all are shown did not come in between"
        assert not any(each["state"]["playing"] for each in came)
        own.send(json.dumps({"own": None}))
        assert index_of(header_where(own, lambda header: index_of(header) != 2)) == 5


def test_the_3d_view_of_a_page_with_its_own_playhead_is_told_its_frame(site: Site):
    def told() -> str | None:
        shown = site.stream._looks.view_of_name(NAME).frame
        return None if shown is None else shown.result.frame

    with site.connected() as own:
        own.send(json.dumps({"page_3d": NAME}))
        go_to(own, 3)
        third = told()
        assert third not in (None, site.first.processed.result.frame)  # type: ignore[union-attr]
        site.show(5)
        _heard(own)
        assert told() == third, "nobody moves it"
        go_to(own, 2)
        assert told() not in (None, third)
        own.send(json.dumps({"own": None}))
        _heard(own)
        assert told() is None


def test_playback_is_paused_when_no_page_follows_it(site: Site):
    with site.connected() as watching, site.connected() as labeling:
        next_header(watching)
        next_header(labeling)
        site.show(1, playing=True)
        go_to(labeling, 3)
        assert site.pauses == [], "somebody watches"
        watching.send(json.dumps({"own": 2}))
        header_where(watching, lambda header: index_of(header) == 2)
        assert len(site.pauses) == 1
        site.show(2, playing=True, recording=RECORDING)
        go_to(labeling, 1)
        assert len(site.pauses) == 1, "what is recorded goes on"
        site.show(3, playing=True, live=True)
        go_to(labeling, 2)
        assert len(site.pauses) == 1, "sensors go on"
    with site.connected("?own=1") as reloaded:
        header_where(reloaded, lambda header: index_of(header) == 1)  # it has come
        site.show(4, playing=True)
        go_to(reloaded, 2)
        assert len(site.pauses) == 2, "who watched has gone"


def go_to(client: ClientConnection, index: int) -> None:
    client.send(json.dumps({"own": index}))
    header_where(client, lambda header: index_of(header) == index)


def test_a_page_with_its_own_playhead_gets_its_frame_again_with_other_parameters_and_after_a_loss(site: Site):
    with site.connected("?own=3") as own:
        assert index_of(next_header(own)) == 3
        other = with_changes(Params(), {"cluster.min_points": 7})
        site.show(6, params=other)
        again = header_where(own, lambda header: sequence_of(header) == 6)  # its own exact frame may come before
        assert index_of(again) == 3
