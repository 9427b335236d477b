"""A device that sends without end takes no more than its share; what real ones send is far below it."""

from __future__ import annotations

import socket
import threading
import time
from collections import Counter

import pytest

from pipeline.replay.nmea_writer import sentences
from pipeline.sources.live.devices import udp
from pipeline.sources.live.devices.device_reader import ReaderStop
from pipeline.sources.live.devices.rate_limit import RateLimit
from pipeline.sources.live.devices.sender_pin import SenderPin
from pipeline.sources.live.source import LiveSensors
from tests.app.waiting import wait_until
from tests.pipeline.sources.live.bench import fix_at
from tests.pipeline.sources.live.rig import free_port, loopback_config, opened, tcp_device

BYTES_S, LINE = 100_000, b"$GPRMC,1*00\r\n"


def test_an_average_and_one_second_of_it_at_once_are_allowed() -> None:
    now_s = [0.0]
    limit = RateLimit(10.0, lambda: now_s[-1])
    assert [limit.allows(1.0) for _ in range(12)] == [True] * 10 + [False] * 2
    now_s.append(0.25)
    assert [limit.allows(1.0) for _ in range(4)] == [True] * 2 + [False] * 2, "what was refused does not count"
    now_s.append(100.0)
    assert [limit.allows(1.0) for _ in range(12)] == [True] * 10 + [False] * 2, "nothing is saved up"
    assert not limit.allows(11.0)


def test_a_receiver_that_sends_lines_without_end_is_given_up_until_it_is_well(sensors: list[LiveSensors]) -> None:
    """Its lines took the program's time: three results a second instead of ten, and gaps in the recording."""
    is_well, ended = threading.Event(), threading.Event()

    def talk(client: socket.socket) -> None:
        while not ended.wait(0.1 if is_well.is_set() else 0.0):
            client.sendall(sentences(fix_at(0), time.time_ns()) if is_well.is_set() else LINE * 5000)

    with tcp_device(talk) as port:
        began_s = time.monotonic()
        source = opened(loopback_config(camera=None, ego=None, gnss={"tcp": f"127.0.0.1:{port}"}), sensors)
        try:
            assert wait_until(lambda: "not a GNSS receiver" in source.health()[1].note)
            assert wait_until(lambda: time.monotonic() - began_s > 2.0)
            lines = source.health()[1].lost
            assert 0 < lines <= BYTES_S / len(LINE) * (time.monotonic() - began_s + 1.0)
            is_well.set()
            assert wait_until(lambda: source.health()[1].state == "ok")
        finally:
            ended.set()


def test_a_flood_by_the_sensors_own_address_is_read_at_the_permitted_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(udp, "_MOST_HZ", 10)
    port, stop, received = free_port(socket.SOCK_DGRAM), ReaderStop(), list[bytes]()
    pin = SenderPin("LiDAR", None, lambda data: True, Counter(), by_port=True, silent_s=60.0)
    began_s = time.monotonic()
    reading = threading.Thread(
        target=udp.read_datagrams, args=(port, "127.0.0.1", None, lambda data, at_ns: received.append(data), pin, stop)
    )
    reading.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sensor:

        def sent_and_read() -> bool:
            for _ in range(20):
                sensor.sendto(b"x", ("127.0.0.1", port))
            return len(received) >= 12

        assert wait_until(sent_and_read)
    stop.set()
    reading.join(60.0)
    assert len(received) <= 10 * (time.monotonic() - began_s + 1.0)
