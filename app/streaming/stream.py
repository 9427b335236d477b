"""Every browser gets the newest message, never an outdated one.

Each client has one slot for a frame and one for a state. A newer message replaces an unsent older one, so a slow client
skips frames without affecting others, and a client that joins late gets the current frame at once. A frame includes the
state, so the state is sent separately only when it is newer than the newest frame.

System buffers between the server and a page can hold many frames, which would act as a queue. A page therefore requests
``?paced=1`` and sends ``{"painted": true}`` once for each frame it received; at most ``FRAMES_UNDER_WAY`` frames are
sent ahead of that. With ``{"picture_px": 833}``, or ``?picture_px=833``, it reports how wide it shows the image; the
image sent to all clients is as wide as the widest of them needs. ``{"own": 12}`` gives the page its own playhead, at
that frame; ``{"own": null}`` makes it follow the shared playhead again.

The other messages concern the page's 3D view, which the server draws (``scene_requests``):
``{"page_3d": "<its name>"}``, ``{"selected": 7}``, ``{"hides_3d": true}``,
``{"labels_3d": {"labels": […], "alone": true}}``, and ``{"held": {"track": 7, "cuboid": …}}``, a label that may be
dragged there, or None. The server reports a drag as
``{"type": "held", "track": 7, "cuboid": …, "ended": true}``, and a picked object as ``{"type": "selected", "id": 7}``.
"""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from app.core.client_role import Role, is_display
from app.core.shared_view_state import FrameInView, HeldCuboid, SharedViewState
from app.engine.page_frames import PageFrame, PageFrames
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from app.streaming.own_playhead import OwnPlayhead
from app.streaming.scene_requests import hear, is_id_or_null
from app.streaming.sent_image import MAX_WIDTH_PX, width_for
from app.streaming.slot import FrameCounts, Slot

_CHANGES_NOTHING = frozenset({"ping", "picture_px", "painted"})
MAY_SAY: Mapping[Role, frozenset[str]] = {
    "display": _CHANGES_NOTHING,
    "person": _CHANGES_NOTHING | {"own", "page_3d", "selected", "hides_3d", "held", "labels_3d"},
}
"""The messages accepted from each role. All others are dropped before anything reads them: a new message works for
nobody until it is listed here."""
_LARGEST_PING = 1e15
"""Milliseconds; a page sends its own clock."""
_WIDEST_PX = 4096


@dataclass(frozen=True)
class _Encoded:
    """A frame's message, and the snapshot whose state it contains. By default none."""

    sequence: int = -1
    message: bytes | None = None
    of: Snapshot | None = None


class Stream:
    """Between the engine's thread, which publishes, and the clients' slots on the event loop."""

    def __init__(
        self,
        looks: SharedViewState | None = None,
        frames: PageFrames | None = None,
        pause: Callable[[], object] = lambda: None,
    ) -> None:
        """frames: for pages with their own playhead; without it all pages follow the shared one. pause: stops the
        playback of a recording; called if every connected page has its own playhead, so that nobody follows it."""
        self.traffic = FrameCounts()
        self._pause = pause
        self._page_frames = frames
        self._pages = ThreadPoolExecutor(1, "cipv-pages")
        self._looks = looks or SharedViewState()
        self._looks.on_drag(self._tell_dragged)
        self._looks.on_pick(self._picked)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._slots: list[Slot] = []
        self._encoder = Encoder()
        # a separate pool, so that frames continue whatever requests do
        self._threads = ThreadPoolExecutor(1, "cipv-stream")
        self._encoding = threading.Lock()
        """Held while a frame is encoded, so never by the event loop, which also answers health checks."""
        self._lock = threading.Lock()
        """Of ``_frame`` and ``_width_px``; held for moments."""
        self._frame = _Encoded()
        self._width_px = MAX_WIDTH_PX
        self._snapshot: Snapshot | None = None

    @property
    def clients(self) -> int:
        """Current number of clients."""
        return len(self._slots)

    def publish(self, snapshot: Snapshot) -> None:
        """Called by the engine. Encodes only while a client is connected, and each result only once."""
        self._snapshot = snapshot
        loop = self._loop
        if loop is None or loop.is_closed() or not self._slots:
            return
        frame = self._encoded(snapshot) if snapshot.sequence > self._frame.sequence else _Encoded()
        try:
            loop.call_soon_threadsafe(self._distribute, snapshot, state_message(snapshot), frame)
        except RuntimeError:  # the server has closed its loop in the meantime
            return

    def close(self) -> None:
        """End the threads that make frames: what waits for them is dropped, and a page's own frame in progress is given
        up at the next opportunity. Nothing is waited for, since a disk may hang. A closed stream serves nobody."""
        for slot in list(self._slots):
            if slot.own is not None:
                slot.own.leave()
        for threads in (self._pages, self._threads):
            threads.shutdown(wait=False, cancel_futures=True)

    async def serve(self, socket: WebSocket) -> None:
        """Serve one client until it disconnects. It may send ``{"ping": t}`` and gets ``t`` back with the server's
        clock."""
        await socket.accept()
        self._loop = asyncio.get_running_loop()
        slot = Slot(socket.query_params.get("paced") == "1", self.traffic)
        slot.image_px = _width(socket.query_params.get("picture_px"))
        self._slots.append(slot)
        self._fit_width()
        try:
            own = _number_of(socket.query_params.get("own"))
            if own is not None:
                await self._go(slot, own)
            elif self._snapshot is not None:
                await self._put_newest(slot, self._snapshot)
            async with asyncio.TaskGroup() as both:
                sender = both.create_task(_send(socket, slot))
                await self._receive(socket, slot)
                sender.cancel()
        except* (WebSocketDisconnect, RuntimeError):
            pass  # the client disconnected during sending
        finally:
            self._slots.remove(slot)
            if slot.own is not None:
                slot.own.leave()
                slot.own = None
            self._looks.leave(slot)
            self._fit_width()

    async def _receive(self, socket: WebSocket, slot: Slot) -> None:
        """Read the client's messages until it disconnects; unknown ones are ignored."""
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            may_say = MAY_SAY["display" if is_display(socket) else "person"]
            said = {name: value for name, value in _object(message.get("text")).items() if name in may_say}
            if (ping := _number(said.get("ping"), _LARGEST_PING)) is not None:
                slot.put("pong", _dump({"type": "pong", "ping": ping, "server_unix_ms": time.time() * 1e3}))
            if (wanted := _width(said.get("picture_px"))) is not None:
                slot.image_px = wanted
                if self._fit_width() and self._snapshot is not None:
                    await self._put_newest(slot, self._snapshot)
            if said.get("painted") is True:
                slot.painted()
            hear(self._looks, slot, said)
            if "own" in said and is_id_or_null(said["own"]):
                await self._go(slot, said["own"])

    async def _go(self, slot: Slot, index: int | None) -> None:
        """A page goes to a frame by itself, or follows the shared playhead again."""
        if index is None or self._page_frames is None:
            if slot.own is not None:
                slot.own.leave()
                slot.own = None
                self._looks.show(slot, None)
                if self._snapshot is not None:
                    await self._put_newest(slot, self._snapshot)
            return
        if slot.own is None:
            slot.own = OwnPlayhead(
                index, self._page_frames, self._pages, self._newest, lambda *each: self._tell_own(slot, *each)
            )
        slot.own.show(index)
        self._pause_unfollowed()

    def _pause_unfollowed(self) -> None:
        """Playback that no page follows would only take processor time from those that label. A session that is being
        recorded needs it."""
        shown = self._snapshot
        plays = shown is not None and shown.playing and not shown.live and shown.recording is None
        if plays and all(slot.own is not None for slot in self._slots):
            self._pause()

    def _newest(self) -> tuple[Snapshot | None, int]:
        """The shared snapshot, and the width of sent images. Any thread."""
        return self._snapshot, self._width_px

    def _tell_own(self, slot: Slot, made: PageFrame, message: bytes, order: int) -> None:
        """Called on the thread that made a page's own frame."""
        if self._loop is not None:
            with suppress(RuntimeError):  # the server closed its loop
                self._loop.call_soon_threadsafe(self._put_own, slot, made, message, order)

    def _put_own(self, slot: Slot, made: PageFrame, message: bytes, order: int) -> None:
        """Ignored if the page has left its own playhead or has closed."""
        if slot.own is None:
            return
        slot.put("frame", message, order)
        self._looks.show(slot, FrameInView(made.processed.frame, made.processed.result))

    def _tell_dragged(self, held: HeldCuboid, ended: bool) -> None:
        """Notify the page that edits the label. Called on a thread of the 3D view."""
        said = {"track": held.track, "frame": held.frame, "cuboid": held.cuboid._asdict(), "ended": ended}
        self._put(held.page, "held", _dump({"type": "held", **said}))

    async def _put_newest(self, slot: Slot, snapshot: Snapshot) -> None:
        """The frame and the current state: the one in the frame may be older than states sent meanwhile."""
        if slot.own is not None:
            slot.own.show(slot.own.index)
            return
        frame = await asyncio.get_running_loop().run_in_executor(self._threads, self._encoded, snapshot)
        if frame.message is not None:
            slot.put("frame", frame.message, frame.sequence)
        slot.put("state", state_message(self._snapshot or snapshot))

    def _fit_width(self) -> bool:
        """Use the width of the widest client. True if it has increased, so that the newest frame's image is too
        narrow."""
        wanted = max((slot.image_px or MAX_WIDTH_PX for slot in self._slots), default=MAX_WIDTH_PX)
        with self._lock:
            has_grown = wanted > self._width_px
            self._width_px = wanted
            if has_grown:
                self._frame = _Encoded()
        return has_grown

    def _encoded(self, snapshot: Snapshot) -> _Encoded:
        """The frame of this snapshot, or a newer one. Not on the event loop."""
        with self._encoding:
            while True:
                with self._lock:
                    newest, width_px = self._frame, self._width_px
                if newest.sequence >= snapshot.sequence or snapshot.processed is None:
                    return newest
                made = _Encoded(snapshot.sequence, self._encoder.message(snapshot, width_px), snapshot)
                with self._lock:
                    if self._width_px <= width_px:  # otherwise a wider client has come meanwhile
                        self._frame = made
                        return made

    def _picked(self, page: object, number: int | None) -> None:
        """Tell a page what was picked in its 3D view. Any thread."""
        self._put(page, "selected", _dump({"type": "selected", "id": number}))

    def _put(self, page: object, kind: str, message: str) -> None:
        """Send to one page. Any thread."""
        if self._loop is not None and isinstance(page, Slot):
            with suppress(RuntimeError):  # the server closed its loop
                self._loop.call_soon_threadsafe(page.put, kind, message)

    def _distribute(self, snapshot: Snapshot, state: str, frame: _Encoded) -> None:
        """state: of the snapshot. The frame may include an older one if it was encoded again for a wider page."""
        is_said = frame.of is snapshot
        for slot in self._slots:
            if slot.own is not None:
                slot.own.seen(snapshot)
                slot.put("state", state_message(slot.own.snapshot(snapshot)))
                continue
            slot.put("state", state)
            if frame.message is not None:
                slot.put("frame", frame.message, frame.sequence)
                if not is_said:
                    slot.put("state", state)


def state_message(snapshot: Snapshot) -> str:
    """The JSON message with the whole state of the page."""
    return _dump({"type": "state", "state": snapshot.state_json()})


async def _send(socket: WebSocket, slot: Slot) -> None:
    while True:
        for message in await slot.take():
            if isinstance(message, bytes):
                await socket.send_bytes(message)
            else:
                await socket.send_text(message)


def _object(text: str | None) -> dict[str, Any]:
    try:
        value = json.loads(text or "null")
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def _number(value: Any, limit: float) -> float | None:
    """A number within ±limit, otherwise None; input from clients is not trusted."""
    return value if isinstance(value, int | float) and -limit < value < limit else None


def _number_of(text: str | None) -> int | None:
    """A frame's number from a URL; None if it is invalid."""
    return int(text) if text is not None and text.isascii() and text.isdecimal() and len(text) < 10 else None


def _width(shown_px: Any) -> int | None:
    """The image width to send to a client that displays it at this width; None for an invalid width."""
    shown = _number(float(shown_px) if isinstance(shown_px, str) and shown_px.isdecimal() else shown_px, _WIDEST_PX)
    return None if shown is None or shown <= 0 else width_for(shown)


def _dump(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
