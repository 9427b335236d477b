"""Packets of LiDARs that are not decoded: their maker is named, and what to do."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from pipeline.formats.other_lidars import maker_of
from pipeline.sources import SourceError, open_source
from tests.pipeline.sources.made.captures import ethernet, pcap

MAKERS = {
    "Ouster by port": (b"\0" * 100, 7502, 6464, "Ouster"),
    "Ouster by length": (b"\0" * 100, 5000, 3392, "Ouster"),
    "Hesai XT16": (b"\xee\xff\x06\x01" + bytes(564), 2368, 568, "Hesai"),
    "Hesai Pandar40": (b"\xff\xee" + bytes(1260), 2368, 1262, "Hesai"),
    "RoboSense RS-16": (b"\x55\xaa\x05\x0a" + bytes(1244), 6699, 1248, "RoboSense"),
    "nobody's": (b"hello", 53, 5, None),
    "a Velodyne's": (b"\xff\xee" + bytes(1204), 2368, 1206, None),
}


@pytest.mark.parametrize("name", MAKERS)
def test_the_maker_is_told_by_a_datagram(name: str) -> None:
    payload, port, length, maker = MAKERS[name]
    assert maker_of(payload, port, length) == maker


@pytest.mark.parametrize("name", ["Hesai XT16", "RoboSense RS-16"])
def test_a_capture_of_one_says_so_in_one_line(name: str, tmp_path: Path) -> None:
    payload, port, _, maker = MAKERS[name]
    (tmp_path / "drive.pcap").write_bytes(pcap([(10**18 + k, port, payload) for k in range(5)]))
    with pytest.raises(SourceError, match=f"drive.pcap: packets of a LiDAR by {maker}, which are not decoded"):
        open_source(str(tmp_path / "drive.pcap"))


def test_an_ousters_datagrams_come_in_parts(tmp_path: Path) -> None:
    """6464 bytes do not fit into one Ethernet frame: the capture contains the first 1472 and the rest separately."""
    frame = bytearray(ethernet(7502, bytes(1472)))
    struct.pack_into(">H", frame, 14 + 6, 0x2000)  # more to come
    struct.pack_into(">H", frame, 14 + 20 + 4, 8 + 6464)
    record = struct.pack("<IIII", 1_700_000_000, 0, len(frame), len(frame)) + bytes(frame)
    (tmp_path / "drive.pcap").write_bytes(pcap([]) + 3 * record)
    with pytest.raises(SourceError, match="packets of a LiDAR by Ouster"):
        open_source(str(tmp_path / "drive.pcap"))
