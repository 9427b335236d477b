"""Velodynes other than the VLP-16. Their packets are built from the manuals, for no recording of one may be passed on;
velodyne-decoder's own reader of captures says what is in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.formats.velodyne import (
    VLP16,
    BadPacket,
    VelodyneDecoder,
    VelodyneModel,
    about_other_models,
    model_of,
    read_packet,
)
from pipeline.formats.velodyne.models import HDL32E, MODELS, PUCK_HI_RES, VLP32C
from pipeline.sources import open_source
from pipeline.types import Sweep
from tests.pipeline.formats.velodyne.streams import START_NS, decoded, drive
from tests.pipeline.sources.made.bags import HEADER_NS, BagWriter
from tests.pipeline.sources.made.captures import pcap

OTHERS = [PUCK_HI_RES, HDL32E, VLP32C]
RANGE_STEP_M = {"VLP-32C": 0.004}
ELEVATION_DEG = {"Puck Hi-Res": (-10.0, 10.0), "HDL-32E": (-30.67, 10.67), "VLP-32C": (-25.0, 15.0)}
BLOCK_US = {"VLP-16": 110.592, "Puck Hi-Res": 110.592, "HDL-32E": 46.08, "VLP-32C": 55.296}
"""From the manuals."""
TURNS_A_SECOND = 10.0


def stream(model: VelodyneModel, sweeps: int = 3, wall_m: float = 10.0) -> list[tuple[bytes, int]]:
    """Single returns of a round wall at 10 Hz, beginning straight behind, and the time of arrival of each packet. On
    the left, the wall is twice as far and as bright."""
    block_us, unit_m, begin_us = BLOCK_US[model.name], RANGE_STEP_M.get(model.name, 0.002), START_NS // 1000
    packets = round(sweeps / TURNS_A_SECOND * 1e6 / block_us / 12)
    found = []
    for number in range(packets):
        data = b""
        for block in range(12):
            azimuth = (18_000 + (12 * number + block) * block_us * 36_000 * TURNS_A_SECOND / 1e6) % 36_000
            is_left = azimuth > 18_000  # clockwise from straight ahead
            one = int((2 if is_left else 1) * wall_m / unit_m).to_bytes(2, "little") + bytes([200 if is_left else 20])
            data += b"\xff\xee" + int(azimuth).to_bytes(2, "little") + one * 32
        t_us = begin_us + number * 12 * block_us
        stamp = int(t_us % 3_600_000_000).to_bytes(4, "little")
        found.append((data + stamp + bytes([0x37, model.product]), round((t_us + 12 * block_us) * 1000)))
    return found


def looked_at(sweep: Sweep, model: VelodyneModel) -> None:
    assert (sweep.channels, len(np.unique(sweep.ring))) == (model.channels, model.channels)
    xyz = sweep.points[:, :3].astype(float)
    azimuth_deg = np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0]))
    range_m = np.linalg.norm(xyz, axis=1)
    clear = (np.abs(azimuth_deg) > 6.0) & (np.abs(azimuth_deg) < 174.0)  # lasers of a VLP-32C look aside by 4°
    left = clear & (azimuth_deg > 0)
    assert np.median(range_m[left]) == pytest.approx(20.0, abs=0.05)
    assert np.median(range_m[clear & ~left]) == pytest.approx(10.0, abs=0.05)
    assert sweep.points[left, 3].min() > 100.0
    elevation_deg = np.degrees(np.arcsin(xyz[:, 2] / range_m))
    of_ring = np.array([np.median(elevation_deg[sweep.ring == ring]) for ring in range(model.channels)])
    assert np.all(np.diff(of_ring) > 0.0), "rings count upwards"
    assert (of_ring[0], of_ring[-1]) == pytest.approx(ELEVATION_DEG[model.name], abs=0.1)
    assert sweep.time_s is not None
    ahead = np.abs(azimuth_deg) < 1.0
    assert sweep.time_s[ahead] == pytest.approx(0.0, abs=2e-3), "its tick is when it looks ahead"
    assert sweep.time_s.max() - sweep.time_s.min() == pytest.approx(0.1, abs=2e-3)


@pytest.mark.parametrize("model", OTHERS, ids=lambda model: model.name)
def test_a_sweep_of_each_model(model: VelodyneModel) -> None:
    sweeps = decoded(VelodyneDecoder(model=model), stream(model))
    assert len(sweeps) >= 2
    looked_at(sweeps[1], model)
    assert sweeps[1].t_ns - sweeps[0].t_ns == pytest.approx(1e8, abs=1e6)


@pytest.mark.parametrize("model", OTHERS, ids=lambda model: model.name)
def test_a_capture_of_each_opens_and_holds_what_the_library_reads_in_it(model: VelodyneModel, tmp_path: Path) -> None:
    from velodyne_decoder import Config, read_pcap

    file = tmp_path / "drive.pcap"
    file.write_bytes(pcap([(t_ns, 2368, packet) for packet, t_ns in stream(model)]))
    source = open_source(str(file))
    assert f"LiDAR: Velodyne {model.name}" in source.notes
    frame = source.frame(1)
    assert frame.sweep is not None
    looked_at(frame.sweep, model)
    (_, cloud), *_ = list(read_pcap(str(file), Config(cut_angle=180.0)))[1:]
    theirs = cloud[np.lexsort(np.round(cloud[:, :3], 3).T)][:, :3]
    ours = frame.sweep.points[np.lexsort(np.round(frame.sweep.points[:, :3], 3).T)][:, :3]
    assert len(ours) == pytest.approx(len(theirs), rel=0.01)
    assert np.linalg.norm(ours.mean(axis=0) - theirs.mean(axis=0)) < 0.05


def test_packets_in_a_bag(tmp_path: Path) -> None:
    packets = stream(HDL32E)
    with BagWriter(tmp_path / "drive", "db3") as bag:
        for begin in range(0, len(packets), 181):
            part = packets[begin : begin + 181]
            bag.write("/velodyne_packets", bag.scan(part), HEADER_NS + part[-1][1] - START_NS)
    frame = open_source(str(tmp_path / "drive")).frame(1)
    assert frame.sweep is not None
    looked_at(frame.sweep, HDL32E)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_model_is_told_by_most_of_the_packets(model: VelodyneModel) -> None:
    packets = [packet for packet, _ in stream(model, sweeps=1)]
    assert model_of(packets) is model
    assert model_of([bytes(1206), b"", packets[0][:1205], drive(1)[0][0], *packets]) is model
    assert model_of([]) is VLP16


def test_packets_of_another_model_are_refused_by_name() -> None:
    (packet, _), *_ = stream(HDL32E)
    assert read_packet(packet, HDL32E).span_us == pytest.approx(12 * 46.08)
    with pytest.raises(BadPacket, match="not a VLP-32C but HDL-32E"):
        read_packet(packet, VLP32C)
    assert about_other_models({"VLS-128 (Alpha Prime)": 3, "HDL-64E": 1}) == (
        "packets of a Velodyne VLS-128 (Alpha Prime); only VLP-16, Puck Hi-Res, HDL-32E, VLP-32C are supported"
    )
