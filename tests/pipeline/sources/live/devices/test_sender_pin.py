"""One sender per port: others are refused, named, and do not affect the first one."""

from __future__ import annotations

import resource
import socket
import threading
from collections import Counter

from pipeline.sources.live.devices.device_reader import ReaderStop
from pipeline.sources.live.devices.sender_pin import OTHERS, BesidePin, SenderPin
from pipeline.sources.live.devices.udp import read_datagrams
from tests.pipeline.sources.live.rig import PATIENCE_S, free_port

SECOND = 1_000_000_000
FIRST, OTHER = ("10.0.0.1", 2368), ("10.0.0.2", 2368)


def pin(allowed: str | None = None, *, by_port: bool = True) -> tuple[SenderPin, Counter[str]]:
    refused: Counter[str] = Counter()
    made = SenderPin(
        "LiDAR", allowed, lambda data: data == b"valid", refused, by_port=by_port, silent_s=1.0, now_s=lambda: 100.0
    )
    return made, refused


def test_the_first_that_sends_something_valid_is_chosen_and_a_second_one_named() -> None:
    chosen, refused = pin()
    assert chosen.takes(b"noise", OTHER, 0), "so that it can be said what is wrong with it"
    assert chosen.sender is None
    assert chosen.takes(b"valid", FIRST, 0)
    assert not chosen.takes(b"valid", OTHER, SECOND // 2)
    assert chosen.sender == FIRST
    assert refused == {OTHERS: 1}
    assert chosen.said() == "a second LiDAR on this port is ignored: 10.0.0.2"
    assert not chosen.takes(b"noise", ("10.0.0.3", 9), SECOND // 2)
    assert "datagrams of 10.0.0.3 are ignored" in chosen.said()


def test_another_port_of_the_address_is_another_sender_only_where_the_sensor_has_one_port() -> None:
    by_port, _ = pin()
    by_address, _ = pin(by_port=False)
    for chosen in (by_port, by_address):
        chosen.takes(b"valid", FIRST, 0)
    assert not by_port.takes(b"valid", (FIRST[0], 9), 0)
    assert by_address.takes(b"valid", (FIRST[0], 9), 0)


def test_one_that_fell_silent_is_replaced_and_that_is_said() -> None:
    chosen, _ = pin()
    chosen.takes(b"valid", FIRST, 0)
    assert not chosen.takes(b"valid", OTHER, SECOND)
    assert chosen.takes(b"valid", OTHER, SECOND + 1)
    assert chosen.said() == "now comes from 10.0.0.2, previously from 10.0.0.1"


def test_a_configured_address_is_the_only_one_for_good() -> None:
    chosen, refused = pin("10.0.0.1")
    assert not chosen.takes(b"valid", OTHER, 0)
    assert chosen.takes(b"valid", FIRST, 0)
    assert not chosen.takes(b"valid", OTHER, 60 * SECOND)
    assert refused[OTHERS] == 2


def test_the_second_port_follows_the_first() -> None:
    chosen, _ = pin()
    beside = BesidePin(chosen, None)
    assert beside.takes(b"position", OTHER, 0)
    chosen.takes(b"valid", FIRST, 0)
    assert not beside.takes(b"position", OTHER, 0)
    assert beside.takes(b"position", (FIRST[0], 8308), 0)


def test_a_flood_of_another_sender_costs_the_first_no_datagram_and_no_memory() -> None:
    """Twenty thousand datagrams, as fast as a thread can send, into a buffer for three thousand; the sensor's two
    thousand in between all arrive."""
    refused: Counter[str] = Counter()
    chosen = SenderPin("LiDAR", None, lambda data: data[:1] == b"s", refused, by_port=True, silent_s=60.0)
    port, stop, came, first = free_port(socket.SOCK_DGRAM), ReaderStop(), [], threading.Event()

    def receive(data: bytes, at_ns: int) -> None:
        came.append(data[:3])
        first.set()

    reader = threading.Thread(target=read_datagrams, args=(port, "127.0.0.1", None, receive, chosen, stop))
    reader.start()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as flood,
    ):
        flood.bind(("127.0.0.2", 0))
        payload = bytes(1203)
        try:
            while not first.wait(0.02):
                sensor.sendto(b"s00" + payload, ("127.0.0.1", port))
            before, grown = len(came), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            for k in range(2000):
                for _ in range(10):
                    flood.sendto(b"s11" + payload, ("127.0.0.1", port))
                sensor.sendto(b"s%02d" % (k % 100) + payload, ("127.0.0.1", port))
            sensor.sendto(b"end" + payload, ("127.0.0.1", port))
            for _ in range(round(PATIENCE_S / 0.02)):
                if came[-1] == b"end":
                    break
                first.clear()
                first.wait(0.02)
        finally:
            stop.set()
            reader.join(PATIENCE_S)
    assert [data for data in came[before:] if data != b"s00"][-1] == b"end"
    assert len(came) - before == 2001
    assert 0 < refused[OTHERS] < 4000, "the system turns away nearly all of them"
    assert "127.0.0.2" in chosen.said()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - grown < 20_000, "kilobytes"
