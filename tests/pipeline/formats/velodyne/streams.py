"""Streams of VLP-16 packets for tests, and ways to damage them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import dpkt
import numpy as np

from pipeline.formats.velodyne import PACKET_BYTES, VelodyneDecoder
from pipeline.formats.velodyne.encode import PACKETS_A_ROTATION, packets_of
from pipeline.types import Sweep

STEP_NS = 100_000_000
PACKET_NS = 1_327_104
START_NS = 1_700_000_000_000_000_000
MODE, PRODUCT, STAMP = 1204, 1205, 1200


def ring_wall(t_ns: int, range_m: float = 10.0) -> Sweep:
    """A round wall, seen by all 16 rings over the whole rotation, with every point on a firing's azimuth."""
    azimuth = np.radians(np.arange(-179.9, 180.0, 0.4))
    elevation = np.radians(np.arange(-15.0, 16.0, 2.0))
    a, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    ring = np.repeat(np.arange(16), len(azimuth)).astype(np.uint8)
    xyz = range_m * np.column_stack([np.cos(e) * np.cos(a), -np.cos(e) * np.sin(a), np.sin(e)])
    return Sweep(t_ns, np.column_stack([xyz, 10.0 + ring]).astype(np.float32), ring, 16)


def drive(sweeps: int) -> list[tuple[bytes, int]]:
    """Packets of a wall that comes 10 cm nearer with every sweep, each with its time of arrival, which is when its last
    laser fired."""
    stream = []
    for index in range(sweeps):
        packets = packets_of(ring_wall(START_NS + index * STEP_NS, 10.0 - 0.1 * index))
        first_ns = START_NS + index * STEP_NS - PACKETS_A_ROTATION * PACKET_NS // 2
        stream += [(packet, first_ns + (i + 1) * PACKET_NS) for i, packet in enumerate(packets)]
    return stream


def decoded(decoder: VelodyneDecoder, stream: list[tuple[bytes, int | None]] | list[tuple[bytes, int]]) -> list[Sweep]:
    """Every sweep of a stream, including the incomplete one at its end."""
    sweeps = [decoder.push(packet, t_host_ns) for packet, t_host_ns in stream]
    return [sweep for sweep in (*sweeps, decoder.flush()) if sweep is not None]


def stamped(packet: bytes, time_us: int) -> bytes:
    """The packet with another timestamp."""
    return packet[:STAMP] + struct.pack("<I", time_us % 2**32) + packet[MODE:]


def time_us(packet: bytes) -> int:
    return int(struct.unpack_from("<I", packet, STAMP)[0])


def with_byte(packet: bytes, at: int, value: int) -> bytes:
    return packet[:at] + bytes([value]) + packet[at + 1 :]


def with_azimuth(packet: bytes, block: int, cdeg: int) -> bytes:
    at = block * 100 + 2
    return packet[:at] + struct.pack("<H", cdeg) + packet[at + 2 :]


def mutated(packet: bytes, rng: np.random.Generator) -> bytes:
    """The packet, damaged in one of the ways in which a network, a disk or another device may damage it."""
    data = bytearray(packet)
    match rng.integers(8):
        case 0:  # some bytes
            for at in rng.integers(len(data), size=rng.integers(1, 20)):
                data[at] = rng.integers(256)
        case 1:  # one bit of the packet's own metadata
            at = int(rng.choice([*(100 * block + k for block in range(12) for k in range(4)), *range(STAMP, 1206)]))
            data[at] ^= 1 << int(rng.integers(8))
        case 2:
            data = bytearray(PACKET_BYTES)
        case 3:
            data = data[: int(rng.integers(len(data)))]
        case 4:
            data += bytes(int(rng.integers(1, 300)))
        case 5:
            data[PRODUCT] = int(rng.choice([0x21, 0x24, 0x28, 0xA1, rng.integers(256)]))
        case 6:  # a block of another packet
            source, target = rng.integers(12, size=2) * 100
            data[target : target + 100] = data[source : source + 100]
        case _:
            data = bytearray(rng.bytes(PACKET_BYTES))
    return bytes(data)


def spoil(stream: list[bytes], share: float, seed: int) -> Iterator[tuple[bytes, bool]]:
    """The stream with this share of damaged packets, half of them replacing the original, half preceding it. Yields
    each packet and whether it is undamaged."""
    rng = np.random.default_rng(seed)
    for packet in stream:
        fate = rng.random()
        if fate < share:
            yield mutated(packet, rng), False
        if fate >= share / 2:
            yield packet, True


def einride(folder: Path) -> list[bytes]:
    raw = (folder / "vlp16_packets" / "einride_recording_1000x1206.bin").read_bytes()
    return [raw[at : at + PACKET_BYTES] for at in range(0, len(raw), PACKET_BYTES)]


def mrpt(folder: Path) -> list[tuple[bytes, int, int]]:
    """Payload, capture time in ns and port of the pcap's packets."""
    with (folder / "vlp16_packets" / "mrpt_sample_velodyne_vlp16_gps.pcap").open("rb") as file:
        frames = [(float(t), dpkt.ethernet.Ethernet(frame).data.data) for t, frame in dpkt.pcap.Reader(file)]
    return [(bytes(udp.data), round(t * 1e6) * 1000, udp.dport) for t, udp in frames]
