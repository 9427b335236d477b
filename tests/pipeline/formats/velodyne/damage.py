"""Compares the decoding of a stream with a share of damaged packets with that of the undamaged stream."""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

import numpy as np

from pipeline.formats.velodyne import VelodyneDecoder
from pipeline.types import Sweep
from tests.pipeline.formats.velodyne.streams import drive, spoil, time_us

_SWEEPS = 40


class Report(NamedTuple):
    packets: int
    spoiled: int
    refused: dict[str, int]
    sweeps: int


def survives(packets: int, share: float, seed: int) -> Report:
    """AssertionError unless every sweep is decoded, with its time and the points of every undamaged packet.

    The same 40 sweeps are sent repeatedly, with new damage, each time to a fresh decoder.

    """
    whole = [packet for packet, _ in drive(_SWEEPS)]
    clean = _decoded([(packet, True) for packet in whole])[0]
    refused: dict[str, int] = {}
    sent = spoiled = sweeps = 0
    while sent < packets:
        stream = list(spoil(whole, share, seed + sent))
        got, decoder = _decoded(stream)
        _compare(clean, got, _good_a_sweep(stream, clean), share)
        for reason, count in decoder.counts.refused.items():
            refused[reason] = refused.get(reason, 0) + count
        sent += len(stream)
        spoiled += sum(not good for _, good in stream)
        sweeps += len(got)
    return Report(sent, spoiled, refused, sweeps)


def _decoded(stream: list[tuple[bytes, bool]]) -> tuple[list[Sweep], VelodyneDecoder]:
    decoder = VelodyneDecoder()
    sweeps = [decoder.push(packet, None) for packet, _ in stream]
    return [sweep for sweep in (*sweeps, decoder.flush()) if sweep is not None], decoder


def _good_a_sweep(stream: list[tuple[bytes, bool]], clean: list[Sweep]) -> list[int]:
    """Number of undamaged packets of each sweep."""
    cuts_us = [sweep.t_ns // 1000 + 49_766 for sweep in clean]
    counts = [0] * len(clean)
    for packet, good in stream:
        if good:
            counts[min(bisect_left(cuts_us, time_us(packet) + 1), len(clean) - 1)] += 1
    return counts


def _compare(clean: list[Sweep], got: list[Sweep], good: list[int], share: float) -> None:
    by_time = {round(sweep.t_ns / 1e6 / 50): sweep for sweep in got}
    for index, (sweep, packets) in enumerate(zip(clean, good, strict=True)):
        found = by_time.get(round(sweep.t_ns / 1e6 / 50))
        is_at_an_end = index in (0, len(clean) - 1)  # its first packets may be damaged, so it may be incomplete
        if found is None and is_at_an_end:
            continue
        assert found is not None, f"sweep {index} is lost: {packets} of its 75 packets were good"
        assert abs(found.t_ns - sweep.t_ns) < 1_000_000
        a_packet = len(sweep.points) / 75
        refused_too = max(2.0, share * packets * 0.1)  # undamaged packets mistaken for copies of a damaged one
        assert len(found.points) >= (packets - refused_too) * a_packet
        assert np.isfinite(found.points).all()
