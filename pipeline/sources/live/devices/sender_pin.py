"""Chooses the sender that a UDP port accepts. UDP has no connections, so anything that reaches the port would be
accepted.

The sender is the first that sends valid data, until it falls silent, or the address given in the configuration. Data of
other senders is rejected, counted and reported, so a second LiDAR on the port cannot corrupt the sweeps of the first.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

SocketAddress = tuple[str, int]
"""A sender's IPv4 address and port."""

_NAMED_S = 3.0
"""Other senders are reported for this long after their last datagram."""
_MOST_NAMED = 3
OTHERS = "from another sender"
"""Reason under which their datagrams are counted."""


class SenderPin:
    """Accepts datagrams of one sender on a port. For one thread; ``said`` for any.

    Args:
        what: display name of the sensor type, such as ``LiDAR``.
        allowed: the only address that may send; None for the first that sends something valid.
        is_valid: whether a datagram comes from such a sensor. Others do not select a sender.
        refused: counter of datagrams of others.
        by_port: the sensor sends everything from one port, so another port of its address is another sender.
        silent_s: a sender without data for this long is gone, and another may take its place.
    """

    def __init__(
        self,
        what: str,
        allowed: str | None,
        is_valid: Callable[[bytes], bool],
        refused: Counter[str],
        *,
        by_port: bool,
        silent_s: float,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._what, self._allowed, self._is_valid, self._refused = what, allowed, is_valid, refused
        self._by_port, self._silent_s, self._now_s = by_port, silent_s, now_s
        self.sender: SocketAddress | None = None
        """The current sender; port 0 stands for any. None before the first, and after it has fallen silent."""
        self._heard_s, self._sent_ns = 0.0, 0
        self._last: SocketAddress | None = None
        self._before: str | None = None
        self._others: dict[str, tuple[float, bool]] = {}

    def takes(self, data: bytes, sender: SocketAddress, at_ns: int) -> bool:
        """Whether to accept a datagram that arrived at ``at_ns``. While there is no sender, everything from an allowed
        address is accepted, so that the reader can report what is wrong with it."""
        host, port = sender
        who = (host, port if self._by_port else 0)
        if who != self.sender:
            has_gone = self.sender is None or at_ns - self._sent_ns > self._silent_s * 1e9
            if not has_gone or self._allowed not in (None, host):
                self._turn_away(data, host)
                return False
            if not self._is_valid(data):
                return True
            self._choose(who)
        self._heard_s, self._sent_ns = self._now_s(), at_ns
        return True

    def nothing_came(self) -> None:
        """There were no datagrams lately."""
        if self.sender is not None and self._now_s() - self._heard_s > self._silent_s:
            self._last, self.sender = self.sender, None

    def said(self) -> str:
        """A message about other senders on the port, and about a change of the sender; empty if there is nothing to
        report."""
        sender = self.sender
        changed = f"now comes from {sender[0]}, previously from {self._before}" if self._before and sender else ""
        return "; ".join(text for text in (self.others(), changed) if text)

    def others(self) -> str:
        """A message about who else sends to the port at present; empty if nobody does."""
        now_s = self._now_s()
        lately = {host: valid for host, (at_s, valid) in tuple(self._others.items()) if now_s - at_s <= _NAMED_S}
        second = [host for host, valid in lately.items() if valid]
        noise = [host for host, valid in lately.items() if not valid]
        return "; ".join(
            text
            for text in (
                f"a second {self._what} on this port is ignored: {_named(second)}" if second else "",
                f"datagrams of {_named(noise)} are ignored" if noise else "",
            )
            if text
        )

    def _choose(self, who: SocketAddress) -> None:
        last = self.sender or self._last
        if last is not None and last[0] != who[0]:
            self._before = last[0]
        self.sender = who
        self._others.pop(who[0], None)

    def _turn_away(self, data: bytes, host: str) -> None:
        self._refused[OTHERS] += 1
        if host in self._others or len(self._others) < _MOST_NAMED:
            self._others[host] = self._now_s(), self._is_valid(data)
            return
        oldest = min(self._others, key=lambda each: self._others[each][0])
        if self._now_s() - self._others[oldest][0] > _NAMED_S:
            del self._others[oldest]


class BesidePin:
    """Accepts datagrams on a sensor's second port: those of the address selected by its first port, or before that of
    the allowed one."""

    def __init__(self, first: SenderPin, allowed: str | None) -> None:
        self._first, self._allowed = first, allowed

    @property
    def sender(self) -> SocketAddress | None:
        first = self._first.sender
        return (first[0], 0) if first is not None else None

    def takes(self, data: bytes, sender: SocketAddress, at_ns: int) -> bool:
        """See ``SenderPin``. Datagrams of others are counted on the first port, not here."""
        first = self._first.sender
        return sender[0] == first[0] if first is not None else self._allowed in (None, sender[0])

    def nothing_came(self) -> None:
        """The first port decides whether the sensor is silent."""


def _named(hosts: list[str]) -> str:
    return ", ".join(hosts)
