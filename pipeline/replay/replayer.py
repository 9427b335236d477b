"""Sends messages when they are due. They are prepared a little ahead on a separate thread, so preparing a frame delays
no packet."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import chain

from pipeline.replay.faults import Fault, disconnected, disturb
from pipeline.replay.messages import Message
from pipeline.replay.senders import Sender
from pipeline.replay.wire import WireEvent, to_wire
from pipeline.sources.live.health import Sensor
from pipeline.types import F64

_AHEAD = 400
"""Number of events prepared ahead: half a second of a VLP-16."""
_START_IN_NS = 300_000_000
_END_S = 3.0
"""How long the thread that prepares messages may take for the one it is at; a camera's frame takes a tenth of that."""
_LATE_NS, _TOO_LATE_NS = 20_000_000, 200_000_000


@dataclass
class ReplayCounts:
    """What was sent, and whether this machine kept up."""

    events: dict[Sensor, int] = field(default_factory=dict)
    """Number of events by sensor."""
    late: int = 0
    """Events sent over 20 ms late."""
    slips: int = 0
    """Number of times that an event was over 200 ms late and all later events were postponed: a sensor may fall silent,
    but it does not lag behind its own clock."""


def replay(
    messages: Iterable[Message],
    senders: Mapping[Sensor, Sender],
    *,
    speed: float = 1.0,
    T_ego_lidar: F64 | None = None,
    faults: Sequence[Fault] = (),
    start_ns: int | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> ReplayCounts:
    """Play to the end, or until ``stopped``. A sensor without a sender is left out. start_ns: start time, unix, by
    default soon; times of faults are relative to it."""
    wanted = (message for message in messages if message.sensor in senders)
    first = next(iter(wanted), None)
    if first is None:
        return ReplayCounts()
    start_ns = time.time_ns() + _START_IN_NS if start_ns is None else start_ns
    events = to_wire(chain([first], wanted), start_ns, speed, T_ego_lidar)
    sent = ReplayCounts()
    plugged = dict.fromkeys(senders, True)
    slipped_ns = 0
    with closing(_made_ahead(disturb(events, faults, start_ns), stopped)) as made:
        for planned in made:
            event = _later(planned, slipped_ns)
            if not _wait_until(event.send_ns, senders, faults, start_ns + slipped_ns, plugged, stopped):
                break
            late_ns = time.time_ns() - event.send_ns
            sent.late += late_ns > _LATE_NS
            if late_ns > _TOO_LATE_NS:
                sent.slips += 1
                slipped_ns += late_ns
                event = _later(event, late_ns)
            senders[event.sensor].send(event.payload, event.stamp_ns)
            sent.events[event.sensor] = sent.events.get(event.sensor, 0) + 1
    return sent


def _later(event: WireEvent, by_ns: int) -> WireEvent:
    return event._replace(send_ns=event.send_ns + by_ns, stamp_ns=event.stamp_ns + by_ns)


def _wait_until(
    at_ns: int,
    senders: Mapping[Sensor, Sender],
    faults: Sequence[Fault],
    start_ns: int,
    plugged: dict[Sensor, bool],
    stopped: Callable[[], bool],
) -> bool:
    """Wait until this time, unplugging and plugging sensors in between. False if it was stopped."""
    while not stopped():
        now_ns = time.time_ns()
        for sensor, sender in senders.items():
            is_in = not disconnected(faults, sensor, (now_ns - start_ns) / 1e9)
            if is_in != plugged[sensor]:
                sender.plug(is_in)
                plugged[sensor] = is_in
        left_s = (at_ns - now_ns) / 1e9
        if left_s <= 0.0:
            return True
        time.sleep(min(left_s, 0.05))
    return False


def _made_ahead(events: Iterator[WireEvent], stopped: Callable[[], bool]) -> Generator[WireEvent, None, None]:
    """The events, prepared by a thread up to ``_AHEAD`` events early. Errors of that thread are raised here. To be
    closed, however it ends: Python ends a thread that is still in a library's C++ at the program's end by unwinding it,
    which aborts the program ("terminate called without an active exception")."""
    made: queue.Queue[WireEvent | BaseException | None] = queue.Queue(_AHEAD)
    done = threading.Event()

    def put(item: WireEvent | BaseException | None) -> None:
        while not done.is_set():
            try:
                return made.put(item, timeout=0.2)
            except queue.Full:
                continue

    def make() -> None:
        try:
            for event in events:
                put(event)
                if done.is_set():
                    return
            put(None)
        except Exception as error:  # passed on to the consumer of the events
            put(error)

    maker = threading.Thread(target=make, name="cipv-replay-maker", daemon=True)
    maker.start()
    try:
        while not stopped():
            try:
                item = made.get(timeout=0.2)
            except queue.Empty:
                continue
            if item is None:
                return
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        done.set()
        maker.join(_END_S)
