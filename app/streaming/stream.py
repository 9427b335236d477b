"""Every browser gets the newest message, never an outdated one.

Each client has one slot for a frame and one for a state. A newer message replaces an unsent older one, so a slow client
skips frames without affecting others, and a client that joins late gets the current frame at once. A frame includes the
state, so the state is sent separately only when it is newer than the newest frame.

Buffers of the system between here and a page hold many frames, which would be a queue after all. A page therefore asks
for ``?paced=1`` and says ``{"painted": true}`` once for each frame it got; no more than ``FRAMES_UNDER_WAY`` are sent
ahead of that. With ``{"picture_px": 833}`` it says how wide it shows the picture: the one that all get is
as wide as the widest of them needs. It may come with ``?picture_px=833`` too.
``{"selected": 7}`` and ``{"hides_3d": true}`` are for the views that the server draws. So is ``{"held": {"track": 7,
"cuboid": …}}``, a label that may be dragged in 3D, or None; the page that holds it hears of the drag as
``{"type": "held", "track": 7, "cuboid": …, "ended": true}``. What is picked in 3D comes to all as
``{"type": "selected", "id": 7}``.
"""

from __future__ import annotations

import asyncio
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, Field, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.core.client_role import is_display
from app.core.request_shapes import CuboidShape
from app.core.shared_view_state import HeldCuboid, SharedViewState
from app.engine.snapshot import Snapshot
from app.streaming.encode import Encoder
from app.streaming.picture import MAX_WIDTH_PX, width_for

FRAMES_UNDER_WAY = 2
"""One being painted while the next is on its way."""

DISPLAY_MAY_SAY = frozenset({"ping", "picture_px", "painted"})
"""What changes nothing for others; of a display everything else is ignored, whatever is added."""
_LARGEST_PING = 1e15
"""Milliseconds; a page sends its own clock."""
_WIDEST_PX = 4096


class _Held(BaseModel):
    """A label that may be dragged in the 3D view."""

    track: int = Field(ge=0, lt=2**53)
    frame: int = Field(ge=0, lt=2**53)
    cuboid: CuboidShape


@dataclass
class Traffic:
    """Frames of all clients since the start: sent, and dropped because a newer one replaced them."""

    sent: int = 0
    dropped: int = 0


class Slot:
    """The newest unsent messages of one client, by kind. Used on the server's event loop only.

    ``paced``: frames wait for ``painted``. ``traffic`` counts frames. picture_px: how wide it shows the image, None
    until it says so."""

    def __init__(self, paced: bool = False, traffic: Traffic | None = None) -> None:
        self.picture_px: int | None = None
        self._paced = paced
        self._traffic = traffic or Traffic()
        self._under_way = 0
        self._unsent: dict[str, str | bytes] = {}
        self._newest: dict[str, int] = {}
        self._state_after_frame: str | bytes | None = None
        self._filled = asyncio.Event()

    def put(self, kind: str, message: str | bytes, order: int = 0) -> None:
        """Replace the unsent message of this kind; a message older than the last one put is ignored."""
        if order < self._newest.get(kind, order):
            return
        self._newest[kind] = order
        replaced = self._unsent.pop(kind, None)  # so that the kinds stand in the order in which they came
        self._traffic.dropped += kind == "frame" and replaced is not None
        self._unsent[kind] = message
        if kind == "frame":
            self._state_after_frame = None
        elif kind == "state" and "frame" in self._unsent:
            self._state_after_frame = message
        self._filled.set()

    def painted(self) -> None:
        """The client has painted one of its frames."""
        self._under_way = max(0, self._under_way - 1)
        self._filled.set()

    async def take(self) -> list[str | bytes]:
        """Wait for messages that may be sent, and take them all."""
        while True:
            await self._filled.wait()
            self._filled.clear()
            is_full = self._paced and self._under_way >= FRAMES_UNDER_WAY
            ready = {kind: message for kind, message in self._unsent.items() if not (is_full and kind == "frame")}
            self._under_way += "frame" in ready
            self._traffic.sent += "frame" in ready
            self._unsent = {kind: message for kind, message in self._unsent.items() if kind not in ready}
            if "frame" in ready:
                ready.pop("state", None)  # the frame includes the state as it was
                if self._state_after_frame is not None:  # also when it has been sent: the frame, late, says what was
                    ready["state"] = self._state_after_frame
                    self._state_after_frame = None
            if ready:
                return list(ready.values())


@dataclass(frozen=True)
class _Encoded:
    """A frame's message, and the snapshot whose state it carries. By default none."""

    sequence: int = -1
    message: bytes | None = None
    of: Snapshot | None = None


class Stream:
    """Between the engine's thread, which publishes, and the clients' slots on the event loop."""

    def __init__(self, looks: SharedViewState | None = None) -> None:
        self.traffic = Traffic()
        self._looks = looks or SharedViewState()
        self._looks.on_drag(self._tell_dragged)
        self._looks.on_pick(self._picked)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._slots: list[Slot] = []
        self._encoder = Encoder()
        self._threads = ThreadPoolExecutor(1, "cipv-stream")  # its own: whatever requests do, frames go on
        self._lock = threading.Lock()
        self._frame = _Encoded()
        self._width_px = MAX_WIDTH_PX
        self._snapshot: Snapshot | None = None

    @property
    def clients(self) -> int:
        """Number of clients now."""
        return len(self._slots)

    def publish(self, snapshot: Snapshot) -> None:
        """Called by the engine. Encodes only while a client is connected, and each result only once."""
        self._snapshot = snapshot
        loop = self._loop
        if loop is None or loop.is_closed() or not self._slots:
            return
        frame = self._encoded(snapshot) if snapshot.sequence > self._frame.sequence else _Encoded()
        try:
            loop.call_soon_threadsafe(self._distribute, state_message(snapshot), frame, frame.of is snapshot)
        except RuntimeError:  # the server closed its loop in between
            return

    async def serve(self, socket: WebSocket) -> None:
        """Serve one client until it leaves. It may send ``{"ping": t}`` and gets ``t`` back with the server's clock."""
        await socket.accept()
        self._loop = asyncio.get_running_loop()
        slot = Slot(socket.query_params.get("paced") == "1", self.traffic)
        slot.picture_px = _width(socket.query_params.get("picture_px"))
        self._slots.append(slot)
        self._fit_width()
        try:
            if self._snapshot is not None:
                await self._put_newest(slot, self._snapshot)
            async with asyncio.TaskGroup() as both:
                sender = both.create_task(_send(socket, slot))
                await self._receive(socket, slot)
                sender.cancel()
        except* (WebSocketDisconnect, RuntimeError):
            pass  # the client left while something was being sent to it
        finally:
            self._slots.remove(slot)
            self._looks.hide(slot, False)
            self._looks.let_go(slot)
            self._fit_width()

    async def _receive(self, socket: WebSocket, slot: Slot) -> None:
        """Read the client's messages until it leaves; unknown ones are ignored."""
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            said = _object(message.get("text"))
            if is_display(socket):
                said = {name: value for name, value in said.items() if name in DISPLAY_MAY_SAY}
            if (ping := _number(said.get("ping"), _LARGEST_PING)) is not None:
                slot.put("pong", _dump({"type": "pong", "ping": ping, "server_unix_ms": time.time() * 1e3}))
            if (wanted := _width(said.get("picture_px"))) is not None:
                slot.picture_px = wanted
                if self._fit_width() and self._snapshot is not None:
                    await self._put_newest(slot, self._snapshot)
            if said.get("painted") is True:
                slot.painted()
            if "selected" in said and _is_id_or_null(said["selected"]):
                self._looks.select(said["selected"])
            if isinstance(said.get("hides_3d"), bool):
                self._looks.hide(slot, said["hides_3d"])
            if "held" in said:
                self._hold(slot, said["held"])

    def _hold(self, slot: Slot, said: Any) -> None:
        """None for anything that is not a valid label."""
        try:
            held = _Held.model_validate(said)
        except ValidationError:
            self._looks.let_go(slot)
        else:
            self._looks.hold(HeldCuboid(slot, held.track, held.frame, held.cuboid.value()))

    def _tell_dragged(self, held: HeldCuboid, ended: bool) -> None:
        """Tell the page that edits the label. Called on a thread of the 3D view."""
        said = {"track": held.track, "frame": held.frame, "cuboid": held.cuboid._asdict(), "ended": ended}
        message = _dump({"type": "held", **said})
        if self._loop is not None and isinstance(held.page, Slot):
            with suppress(RuntimeError):  # the server closed its loop
                self._loop.call_soon_threadsafe(held.page.put, "held", message)

    async def _put_newest(self, slot: Slot, snapshot: Snapshot) -> None:
        """The frame, and the state as it is now: the one in the frame may be older than what was told meanwhile."""
        frame = await asyncio.get_running_loop().run_in_executor(self._threads, self._encoded, snapshot)
        if frame.message is not None:
            slot.put("frame", frame.message, frame.sequence)
        slot.put("state", state_message(self._snapshot or snapshot))

    def _fit_width(self) -> bool:
        """Use the width of the widest client. True when it has grown, so that the newest frame's image is too
        narrow."""
        wanted = max((slot.picture_px or MAX_WIDTH_PX for slot in self._slots), default=MAX_WIDTH_PX)
        with self._lock:
            has_grown = wanted > self._width_px
            self._width_px = wanted
            if has_grown:
                self._frame = _Encoded()
        return has_grown

    def _encoded(self, snapshot: Snapshot) -> _Encoded:
        """The frame of this snapshot, or a newer one."""
        with self._lock:
            if self._frame.sequence < snapshot.sequence and snapshot.processed is not None:
                message = self._encoder.message(snapshot, self._width_px)
                self._frame = _Encoded(snapshot.sequence, message, snapshot)
            return self._frame

    def _picked(self, number: int | None) -> None:
        """Tell every page what was picked in the 3D view. Any thread."""
        loop, message = self._loop, _dump({"type": "selected", "id": number})
        if loop is not None and not loop.is_closed():
            loop.call_soon_threadsafe(self._tell, "selected", message)

    def _tell(self, kind: str, message: str) -> None:
        for slot in self._slots:
            slot.put(kind, message)

    def _distribute(self, state: str, frame: _Encoded, is_said: bool) -> None:
        """is_said: the frame includes this state. A frame encoded again for a wider page may include an older one."""
        for slot in self._slots:
            slot.put("state", state)
            if frame.message is not None:
                slot.put("frame", frame.message, frame.sequence)
                if not is_said:
                    slot.put("state", state)


def state_message(snapshot: Snapshot) -> str:
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


def _is_id_or_null(value: Any) -> bool:
    return value is None or (isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53)


def _width(shown_px: Any) -> int | None:
    """The width to send to a client that shows it this wide; None for an invalid width."""
    shown = _number(float(shown_px) if isinstance(shown_px, str) and shown_px.isdecimal() else shown_px, _WIDEST_PX)
    return None if shown is None or shown <= 0 else width_for(shown)


def _dump(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
