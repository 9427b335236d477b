"""The newest unsent messages of one client: a slow client skips frames and never gets an outdated one."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from app.streaming.own_playhead import OwnPlayhead

FRAMES_UNDER_WAY = 2
"""One frame is painted while the next is in transit."""


@dataclass
class FrameCounts:
    """Frames of all clients since the start."""

    sent: int = 0
    """Frames passed to a connection."""
    dropped: int = 0
    """Frames replaced by a newer one before they were sent."""


class Slot:
    """The newest unsent messages of one client, by kind. Used on the server's event loop only.

    ``paced``: frames wait for ``painted``. ``traffic`` counts frames. image_px: the width at which the client shows the
    image, None until it reports it.
    """

    def __init__(self, paced: bool = False, traffic: FrameCounts | None = None) -> None:
        self.image_px: int | None = None
        self.own: OwnPlayhead | None = None
        """None while the page follows the shared playhead."""
        self._paced = paced
        self._traffic = traffic or FrameCounts()
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
        replaced = self._unsent.pop(kind, None)  # keeps the kinds in order of arrival
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
        """Wait for messages that may be sent, and remove and return all of them."""
        while True:
            await self._filled.wait()
            self._filled.clear()
            is_full = self._paced and self._under_way >= FRAMES_UNDER_WAY
            ready = {kind: message for kind, message in self._unsent.items() if not (is_full and kind == "frame")}
            self._under_way += "frame" in ready
            self._traffic.sent += "frame" in ready
            self._unsent = {kind: message for kind, message in self._unsent.items() if kind not in ready}
            if "frame" in ready:
                ready.pop("state", None)  # the frame includes the state at its time
                # even if it was sent before: the late frame has carried an older state
                if self._state_after_frame is not None:
                    ready["state"] = self._state_after_frame
                    self._state_after_frame = None
            if ready:
                return list(ready.values())
