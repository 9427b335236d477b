"""Decoding the packets of one rotation into a sweep, with all checks, compared with the bare library and with plain
Python."""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import cycle
from math import cos, radians, sin
from typing import Any

import numpy as np
from velodyne_decoder import Config, Model, StreamDecoder

from app.bench.timing import figures, interleaved
from pipeline.common.files.data_dir import data_dir
from pipeline.formats.velodyne import PACKET_BYTES, RotationCutter, SensorClock, VelodyneDecoder
from pipeline.formats.velodyne.encode import packets_of
from pipeline.formats.velodyne.packet import BLOCK_US
from pipeline.sources import open_source

OURS = "ours"
_SIMULATED = 12
_DUAL_RETURN = 0x39
_METRE = 500  # in steps of 2 mm
_COSINES = [cos(radians(2 * (laser // 2 + 8 * (laser % 2)) - 15)) for laser in range(16)]
_SINES = [sin(radians(2 * (laser // 2 + 8 * (laser % 2)) - 15)) for laser in range(16)]

Rotations = list[list[bytes]]


def stages(budget_s: float) -> dict[str, dict[str, Any]]:
    """``decode`` and ``decode dual`` as ``cipv bench --json`` prints them: one rotation, packet by packet, decoded to a
    sweep in the ego frame, from a sensor in single-return and in dual-return mode."""
    packets = _recorded() or _simulated()
    return {
        "decode": _stage(_rotations(packets), budget_s / 2),
        "decode dual": _stage(_rotations(_with_two_returns(packets)), budget_s / 2),
    }


def _stage(rotations: Rotations, budget_s: float) -> dict[str, Any]:
    contestants = {
        OURS: _ours(rotations),
        "velodyne_decoder, unguarded": _library(rotations),
        "plain Python": _plain(rotations),
    }
    times = interleaved(contestants, budget_s)
    median = {name: float(np.median(spent)) * 1e3 for name, spent in times.items()}
    peers = {name: {"median_ms": ms, "ratio": ms / median[OURS]} for name, ms in median.items() if name != OURS}
    return {
        **figures(times[OURS]),
        "packets": round(float(np.mean([len(rotation) for rotation in rotations])), 1),
        "peers": peers,
    }


def _recorded() -> list[bytes]:
    """Payloads of a real sensor, stored back to back in a file; empty without that file."""
    folder = data_dir() / "vlp16_packets"
    for path in sorted(folder.glob(f"*x{PACKET_BYTES}.bin")) if folder.is_dir() else ():
        raw = path.read_bytes()
        return [raw[at : at + PACKET_BYTES] for at in range(0, len(raw) - PACKET_BYTES + 1, PACKET_BYTES)]
    return []


def _simulated() -> list[bytes]:
    """The simulator's sweeps as packets. They cover only the front half turn, so they hold half as many points."""
    source = open_source("sim:straight")
    sweeps = (source.frame(index).sweep for index in range(_SIMULATED))
    return [packet for sweep in sweeps if sweep is not None for packet in packets_of(sweep)]


def _with_two_returns(packets: list[bytes]) -> list[bytes]:
    """The same rotations in dual-return mode, with twice as many packets: each block is repeated with its returns one
    metre farther away."""
    doubled = []
    for packet in packets:
        for half in (0, 6):
            blocks = [packet[at * 100 : at * 100 + 100] for at in range(half, half + 6)]
            blocks = [each for block in blocks for each in (block, _behind(block))]
            time_us = struct.unpack_from("<I", packet, 1200)[0] + round(half * BLOCK_US)
            doubled.append(b"".join(blocks) + struct.pack("<IBB", time_us, _DUAL_RETURN, packet[1205]))
    return doubled


def _behind(block: bytes) -> bytes:
    returns = np.frombuffer(block[4:], dtype=np.dtype([("range", "<u2"), ("reflectivity", "u1")])).copy()
    returns["range"][returns["range"] > 0] += _METRE
    return block[:4] + returns.tobytes()


def _rotations(packets: list[bytes]) -> Rotations:
    cutter = RotationCutter(np.eye(4), SensorClock())
    rotations = [*(cutter.push(packet, None) for packet in packets), cutter.flush()]
    return [[placed.data for placed in rotation.packets] for rotation in rotations if rotation is not None]


def _ours(rotations: Rotations) -> Callable[[], object]:
    """Push the packets of one rotation; the first one completes the previous sweep."""
    turn, decoder = cycle(enumerate(rotations)), VelodyneDecoder()

    def run() -> object:
        nonlocal decoder
        index, packets = next(turn)
        if index == 0:
            decoder = VelodyneDecoder()
        sweeps = [decoder.push(packet, None) for packet in packets]
        return decoder.flush() if index == len(rotations) - 1 else sweeps

    return run


def _library(rotations: Rotations) -> Callable[[], object]:
    turn, decoder = cycle(enumerate(rotations)), StreamDecoder(Config(model=Model.VLP16))
    at_s = 0.0

    def run() -> object:
        nonlocal decoder, at_s
        index, packets = next(turn)
        if index == 0:
            decoder, at_s = StreamDecoder(Config(model=Model.VLP16)), 0.0
        done = None
        for packet in packets:
            at_s += 0.00132
            done = decoder.decode(at_s, packet) or done
        return done

    return run


def _plain(rotations: Rotations) -> Callable[[], object]:
    turn = cycle(rotations)
    return lambda: [point for packet in next(turn) for point in _points(packet)]


def _points(packet: bytes) -> list[tuple[float, float, float, int]]:
    """x, y, z, intensity of a single-return packet, ignoring time and damage."""
    points = []
    azimuths = struct.unpack("<" + "2xH96x" * 12, packet[:1200])
    for block, azimuth in enumerate(azimuths):
        step = (azimuths[min(block + 1, 11)] - azimuths[min(block, 10)]) % 36_000
        returns = struct.unpack_from("<" + "HB" * 32, packet, block * 100 + 4)
        for k in range(32):
            if returns[2 * k]:
                laser = k % 16
                turned = (k // 16 * 55.296 + laser * 2.304) / 110.592
                angle = radians((azimuth + step * turned) / 100.0)
                range_m = returns[2 * k] * 0.002
                flat = range_m * _COSINES[laser]
                points.append((flat * cos(angle), -flat * sin(angle), range_m * _SINES[laser], returns[2 * k + 1]))
    return points
