"""Datagrams out of capture files of every kind."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.sources import SourceError
from pipeline.sources.pcap.capture import Capture
from tests.pipeline.sources.made.captures import ethernet, pcap, pcapng

SENT = [(1_700_000_000_123_456_000 + i * 1_000_000, 2368 + i, bytes([i]) * (10 + i)) for i in range(5)]
KINDS: dict[str, Callable[[], bytes]] = {
    "pcap": lambda: pcap(SENT),
    "pcap, big-endian": lambda: pcap(SENT, ">"),
    "pcap, ns": lambda: pcap(SENT, nano=True),
    "pcap, ns, big-endian": lambda: pcap(SENT, ">", nano=True),
    "pcap, Linux cooked": lambda: pcap(SENT, link=113),
    "pcap, raw IP": lambda: pcap(SENT, link=101),
    "pcapng": lambda: pcapng(SENT),
    "pcapng, third interface": lambda: pcapng(SENT, interface=2),
    "pcapng, two sections": lambda: pcapng(SENT[:1]) + pcapng(SENT[1:], ">", nano=False, interface=1),
    "pcapng, µs, big-endian": lambda: pcapng(SENT, ">", nano=False),
}


def opened(folder: Path, data: bytes) -> Capture:
    path = folder / "a.pcap"
    path.write_bytes(data)
    return Capture(path)


@pytest.mark.parametrize("kind", KINDS)
def test_every_datagram_with_its_time(kind: str, tmp_path: Path) -> None:
    capture = opened(tmp_path, KINDS[kind]())
    found = list(capture.datagrams())
    assert [(it.t_ns, it.port, it.payload) for it in found] == SENT
    assert capture.damage is None
    again = list(capture.datagrams(found[2].origin, found[3].origin))
    assert again == found[2:4]
    never_read = Capture(capture.path)
    assert list(never_read.datagrams(found[2].origin, found[3].origin)) == found[2:4]


@pytest.mark.parametrize("kind", ["pcap", "pcapng"])
def test_a_cut_file_gives_what_is_whole(kind: str, tmp_path: Path) -> None:
    data = KINDS[kind]()
    capture = opened(tmp_path, data[:-20])
    assert [it.port for it in capture.datagrams()] == [2368, 2369, 2370, 2371]
    assert capture.damage is not None
    assert capture.damage.startswith("cut off after")


@pytest.mark.parametrize("kind", ["pcap", "pcapng"])
def test_a_damaged_length_reads_no_gigabytes(kind: str, tmp_path: Path) -> None:
    data = bytearray(KINDS[kind]())
    third = list(opened(tmp_path, bytes(data)).datagrams())[2].origin
    at = third + (8 if kind == "pcap" else 4)
    data[at : at + 4] = struct.pack("<I", 0x7FFFFFF0)
    capture = opened(tmp_path, bytes(data))
    assert [it.port for it in capture.datagrams()] == [2368, 2369]
    assert capture.damage == f"damaged after {third} bytes"


def test_vlan_and_ipv6(tmp_path: Path) -> None:
    frames = [
        ethernet(7, b"abc", vlan=True),
        ethernet(8, b"def", version=6),
        ethernet(9, b"tcp", kind=6),
        b"",
        bytes(60),
    ]
    data = pcap([])
    for frame in frames:
        data += struct.pack("<IIII", 1, 0, len(frame), len(frame)) + frame
    assert [(it.port, it.payload) for it in opened(tmp_path, data).datagrams()] == [(7, b"abc"), (8, b"def")]


def test_a_fragment_is_no_datagram(tmp_path: Path) -> None:
    frame = bytearray(ethernet(7, b"abc"))
    frame[14 + 6] |= 0x20  # more fragments
    data = pcap([]) + struct.pack("<IIII", 1, 0, len(frame), len(frame)) + bytes(frame)
    assert list(opened(tmp_path, data).datagrams()) == []


@pytest.mark.parametrize("data", [b"", b"GIF89a", bytes(100)])
def test_something_else_is_refused(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="neither a pcap nor a pcapng file"):
        opened(tmp_path, data)


def test_a_packet_beyond_the_end_of_time_is_left_out(tmp_path: Path) -> None:
    beyond = pcapng([*SENT[:2], ((1 << 63) + 5, 2368, b"late")])
    assert [it.payload for it in opened(tmp_path, beyond).datagrams()] == [payload for _, _, payload in SENT[:2]]
    a_tick_a_second = beyond.replace(struct.pack("<HHB3x", 9, 1, 9), struct.pack("<HHB3x", 9, 1, 0))
    assert list(opened(tmp_path, a_tick_a_second).datagrams()) == []
