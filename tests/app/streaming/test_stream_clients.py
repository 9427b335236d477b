"""The stream over real sockets: several clients at once, one of them slow, one that joins late."""

from __future__ import annotations

import json
import struct
import threading
from typing import Any
from urllib.parse import quote

import pytest
from websockets.sync.client import ClientConnection

from app.engine.snapshot import Snapshot
from app.streaming.sent_image import MAX_WIDTH_PX
from app.streaming.slot import FRAMES_UNDER_WAY
from tests.app.streaming.stream_site import (
    WAIT_S,
    Site,
    header_where,
    heard,
    next_header,
    sequence_of,
)

FAST_FRAMES = 40
"""More than the system's buffers hold between a server and a client that does not read."""


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
        heard(narrow)
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
        heard(client)
        site.show(1)
        width = next_header(client)["picture"]["width"]
    assert width == MAX_WIDTH_PX


@pytest.mark.parametrize("said", ["²", "wide", "9" * 400, ""])
def test_a_nonsense_width_in_the_address_changes_nothing(site: Site, said: str):
    with site.connected(f"?picture_px={quote(said)}") as client:
        assert next_header(client)["picture"]["width"] == MAX_WIDTH_PX
