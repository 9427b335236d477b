"""The packet decoder benchmark: what it prints, and peers that do the same work."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from app.bench import packets
from pipeline.formats.velodyne import VelodyneDecoder
from pipeline.formats.velodyne.encode import PACKETS_A_ROTATION
from tests.pipeline.formats.velodyne.streams import drive


def test_decode_has_its_figures_also_without_recordings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("CIPV_DATA", str(tmp_path))
    figures = packets.stages(0.3)
    assert {name: round(row["packets"]) for name, row in figures.items()} == {
        "decode": PACKETS_A_ROTATION,
        "decode dual": 2 * PACKETS_A_ROTATION,
    }
    for row in figures.values():
        assert 0.0 < row["median_ms"] <= row["p99_ms"]
        assert list(row["peers"]) == ["velodyne_decoder, unguarded", "plain Python"]
        assert row["peers"]["plain Python"]["ratio"] > 1.0


def test_two_returns_are_every_point_twice() -> None:
    sent = [packet for packet, _ in drive(3)]
    decoder = VelodyneDecoder()
    sweeps = [sweep for packet in packets._with_two_returns(sent) if (sweep := decoder.push(packet)) is not None]
    assert [len(sweep.points) for sweep in sweeps] == [2 * 14_400] * 2


def test_every_contestant_decodes_the_rotation() -> None:
    rotations = packets._rotations([packet for packet, _ in drive(3)])
    assert [len(rotation) for rotation in rotations] == [PACKETS_A_ROTATION] * 3
    plain = packets._plain(rotations)()
    assert len(plain) == 14_400  # type: ignore[arg-type]
    x, y, z, _ = plain[0]  # type: ignore[index]
    assert math.sqrt(x * x + y * y + z * z) == pytest.approx(10.0, abs=0.01)
    ours, library = packets._ours(rotations), packets._library(rotations)
    ours(), library()
    sweeps, (_, cloud) = [it for it in ours() if it is not None], library()  # type: ignore[union-attr, misc, attr-defined]
    assert len(sweeps[0].points) == 14_400
    assert len(cloud) == 14_400 + 192, "the library alone cuts a packet too late"
