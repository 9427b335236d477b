"""Captures as recordings, with what lies beside them."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from pipeline.detection import Detectors
from pipeline.params import Params
from pipeline.run import run
from pipeline.sources import Source, SourceError, open_source
from tests.pipeline.formats.velodyne.streams import PRODUCT, START_NS, STEP_NS, mrpt, with_byte
from tests.pipeline.sources.made.captures import RIG, lidar, pcap, pcapng, sentences, write_capture, write_video


def opened(folder: Path, data: bytes, options: str = "") -> Source:
    (folder / "drive.pcap").write_bytes(data)
    return open_source(f"pcap:{folder / 'drive.pcap'}{options}")


def test_everything_beside_is_found(tmp_path: Path) -> None:
    source = open_source(f"pcap:{write_capture(tmp_path / 'c') / 'drive.pcap'}")
    assert (len(source), source.rate_hz, source.title) == (3, 10.0, "drive")
    assert any("assumed to start with the recording" in note for note in source.notes)
    assert any("4 GNSS fixes from drive.nmea" in note for note in source.notes)
    for index, grey in enumerate(
        (20, 80, 120)
    ):  # 25 a second since the first packet, which came 0.048 s before the tick
        frame = source.frame(index)
        assert frame.t_ns == source.t_ns(index) == pytest.approx(START_NS + index * STEP_NS, abs=2_000)
        assert frame.sweep is not None
        assert frame.sweep.t_ns == frame.t_ns
        assert len(frame.sweep.points) == 14_400
        assert np.median(np.linalg.norm(frame.sweep.points[:, :3] - [0, 0, 1], axis=1)) == pytest.approx(
            10 - index / 10, 1e-3
        )
        assert frame.image is not None
        assert frame.image.t_ns is not None
        assert abs(frame.image.t_ns - frame.t_ns) <= 20_000_000
        assert np.median(frame.image.bgr) == pytest.approx(grey, abs=3)
        assert frame.camera is not None
        assert frame.camera.T_camera_ego[1, 3] == pytest.approx(1.2)
        assert frame.gnss is not None
        assert frame.gnss.quality == "rtk_fixed"
        assert frame.ego is not None
        assert frame.ego.speed_mps == pytest.approx(10.0, abs=0.01)
        assert frame.notes == ()
        assert source.truth(index) is None


def test_frames_in_any_order_are_the_same(tmp_path: Path) -> None:
    source = open_source(f"pcap:{write_capture(tmp_path / 'c') / 'drive.pcap'}")
    forward = [source.frame(index) for index in range(3)]
    for index in (2, 0, 1, 1):
        frame = source.frame(index)
        assert frame.sweep is not None
        assert frame.sweep.points.tobytes() == forward[index].sweep.points.tobytes()  # type: ignore[union-attr]
        assert np.array_equal(frame.image.bgr, forward[index].image.bgr)  # type: ignore[union-attr]


def test_a_lidar_on_the_second_interface(tmp_path: Path) -> None:
    source = opened(tmp_path, pcapng(lidar(3), interface=1))
    sweeps = [source.frame(index).sweep for index in range(3)]
    assert [len(sweep.points) for sweep in sweeps if sweep is not None] == [14_400] * 3


def test_the_line_runs_on_it(tmp_path: Path) -> None:
    source = opened(tmp_path, pcap(lidar(3)))
    results = [result for _, result in run(source, Params(), Detectors())]
    assert [result.sensors.lidar_points for result in results] == [14_400] * 3


def test_nothing_beside(tmp_path: Path) -> None:
    source = opened(tmp_path, pcapng(lidar(2)))
    frame = source.frame(1)
    assert (frame.image, frame.camera, frame.gnss, frame.ego, frame.notes) == (None, None, None, None, ())
    assert source.notes[-1] == "no ego speed recorded"
    assert "not synchronised to GPS" in source.notes[0]


def test_a_damaged_video_beside_a_capture_costs_its_images_only(tmp_path: Path) -> None:
    folder = write_capture(tmp_path / "c")
    (folder / "drive.avi").write_bytes(b"RIFF....AVI LIST")
    source = open_source(str(folder / "drive.pcap"))
    assert any("no images: drive.avi: not a readable video" in note for note in source.notes)
    frame = source.frame(0)
    assert frame.sweep is not None
    assert any("no images: drive.avi" in note for note in frame.notes)


def test_options_name_other_files_and_shift_the_video(tmp_path: Path) -> None:
    write_video(tmp_path / "front.mp4", 8, codec="mpeg4")
    (tmp_path / "gps.txt").write_text("".join(sentences(range(2))), encoding="ascii")
    (tmp_path / "rig.yml").write_text(RIG, encoding="utf-8")
    options = "?video=front.mp4&video_offset_s=0.1&nmea=gps.txt&rig=rig.yml"
    frame = opened(tmp_path, pcap(lidar(3)), options).frame(1)
    assert frame.image is not None
    assert np.median(frame.image.bgr) == pytest.approx(20, abs=4)
    assert frame.gnss is not None
    assert frame.camera is not None


def test_another_port(tmp_path: Path) -> None:
    other = lidar(3, port=2369)
    assert len(opened(tmp_path, pcap(other))) == 3
    assert len(opened(tmp_path, pcap(other), "?port=2369")) == 3
    with pytest.raises(SourceError, match="no Velodyne packets"):
        opened(tmp_path, pcap(other), "?port=2368")


def test_bad_packets_are_told(tmp_path: Path) -> None:
    sent = lidar(3)
    sent[100:100] = [(sent[100][0], 2368, bytes(1206))]
    del sent[80]
    source = opened(tmp_path, pcap(sent))
    assert "1 packet refused: 1 all zero" in source.notes
    assert "1 packets lost" in source.notes
    assert source.frame(0).notes == ()
    assert source.frame(1).notes == ("LiDAR: 1 packet refused: 1 all zero", "LiDAR: 1 packets lost")


WRONG = {
    "no file": ("pcap:", "no file given"),
    "missing": ("pcap:{folder}/missing.pcap", "no such file"),
    "folder": ("pcap:{folder}", "a folder, not a file"),
    "option": ("pcap:{file}?colour=red", "unknown option 'colour'; the options are port, video"),
    "twice": ("pcap:{file}?port=1&port=2", "given twice"),
    "no number": ("pcap:{file}?port=many", "port=many: not a number"),
    "no video": ("pcap:{file}?video=other.mp4", "video=other.mp4: no such file"),
    "nobody's rig": ("pcap:{file}?rig=~no_such_user_here/rig.yaml", "unknown home directory"),
    "bad video": ("pcap:{file}?video=rig.yaml", "rig.yaml: not a readable video"),
    "bad rig": ("pcap:{file}?rig=bad.yaml", "bad.yaml: lidar.mount.z_m: Input should be less than or equal to 20"),
    "no rig": ("pcap:{file}?rig=drive.pcap", "drive.pcap: not YAML"),
    "rig backwards": ("pcap:{file}?rig=back.yaml", "does not look ahead"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_in_one_sentence(name: str, tmp_path: Path) -> None:
    uri, says = WRONG[name]
    (tmp_path / "drive.pcap").write_bytes(pcap(lidar(2)))
    (tmp_path / "rig.yaml").write_text(RIG)
    (tmp_path / "bad.yaml").write_text("lidar: {mount: {z_m: 50}}")
    (tmp_path / "back.yaml").write_text(RIG.replace("mount: {z_m: 1.2}", "mount: {yaw_deg: 180}"))
    with pytest.raises(SourceError) as error:
        open_source(uri.format(folder=tmp_path, file=tmp_path / "drive.pcap"))
    assert says in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="a file that opens and cannot be read is in /proc")
def test_a_disc_that_fails_is_named() -> None:
    with pytest.raises(SourceError, match="mem: cannot be read: Input/output error"):
        open_source("pcap:/proc/self/mem")


def test_another_velodyne_is_named(tmp_path: Path) -> None:
    others = [(t_ns, port, with_byte(packet, PRODUCT, 0xA1)) for t_ns, port, packet in lidar(2)]
    with pytest.raises(
        SourceError, match=r"drive.pcap: packets of a Velodyne VLS-128 \(Alpha Prime\); only VLP-16, .* VLP-32C are"
    ):
        opened(tmp_path, pcap(others))


def test_cut_in_the_middle_of_a_sweep(tmp_path: Path) -> None:
    source = opened(tmp_path, pcap(lidar(3))[: 24 + 100 * 1264 + 7])
    assert len(source) == 1
    assert any("the file is cut off after" in note for note in source.notes)


def test_a_file_that_goes_away_degrades(tmp_path: Path) -> None:
    source = opened(tmp_path, pcap(lidar(2)))
    (tmp_path / "drive.pcap").unlink()
    frame = source.frame(0)
    assert frame.sweep is None
    assert "cannot be read" in frame.notes[0]


def test_memory_does_not_grow_with_the_file_and_opening_says_how_far_it_is(tmp_path: Path) -> None:
    """The file contains 75 packets of 1.2 kB per sweep, of which a few dozen bytes per sweep stay in memory."""
    path = tmp_path / "drive.pcap"
    head, body = pcap([]), pcap(lidar(2))[24:]
    with path.open("wb") as file:
        file.write(head)
        for round_ in range(30):
            file.write(later(body, round_ * 200_000_000))
    told: list[tuple[int, int]] = []
    (tmp_path / "short.pcap").write_bytes(pcap(lidar(2)))
    open_source(f"pcap:{tmp_path / 'short.pcap'}")  # imports and compiled code are here by now
    tracemalloc.start()
    source = open_source(f"pcap:{path}", progress=lambda done, total: told.append((done, total)))
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(source) == 60
    assert path.stat().st_size > 5.5e6
    assert kept < 0.4e6
    size = path.stat().st_size
    assert {total for _, total in told} == {size}
    shares = [done / size for done, _ in told]
    assert shares == sorted(shares)
    assert len(shares) >= 2
    assert shares[-1] > 0.6
    assert source.frame(50).sweep is not None


def later(body: bytes, by_ns: int) -> bytes:
    """Records of a capture and their packets, later by this much."""
    rows = np.frombuffer(body, np.uint8).reshape(-1, 1264).copy()
    seconds, micros = (rows[:, at : at + 4].view("<u4")[:, 0].astype(np.int64) for at in (0, 4))
    t_us = seconds * 1_000_000 + micros + by_ns // 1000
    rows[:, 0:4] = (t_us // 1_000_000).astype("<u4")[:, None].view(np.uint8)
    rows[:, 4:8] = (t_us % 1_000_000).astype("<u4")[:, None].view(np.uint8)
    stamps = rows[:, 58 + 1200 : 58 + 1204].copy().view("<u4")[:, 0].astype(np.int64) + by_ns // 1000
    rows[:, 58 + 1200 : 58 + 1204] = (stamps % 3_600_000_000).astype("<u4")[:, None].view(np.uint8)
    return rows.tobytes()


def test_mrpt(data_dir: Path) -> None:
    """Indoors: walls within a few metres all round."""
    source = open_source(f"pcap:{data_dir / 'vlp16_packets' / 'mrpt_sample_velodyne_vlp16_gps.pcap'}")
    assert len(source) == 3
    assert source.notes[0] == "LiDAR times are UTC: the sensor is synchronised to GPS"
    frame = source.frame(1)
    assert frame.sweep is not None
    assert 18_000 < len(frame.sweep.points) < 19_000
    assert np.percentile(np.linalg.norm(frame.sweep.points[:, :3], axis=1), 95) < 6.0
    assert frame.gnss is not None, "from the position packets"
    assert (round(frame.gnss.lat_deg, 4), round(frame.gnss.lon_deg, 4)) == (36.8291, -2.4076)
    assert len(mrpt(data_dir)) == 350


def test_stamps_of_a_damaged_header_do_not_go_back(tmp_path: Path) -> None:
    data = bytearray(pcap(lidar(3)))
    at = 24 + 120 * 1264
    data[at : at + 4] = struct.pack("<I", 1)
    source = opened(tmp_path, bytes(data))
    assert np.all(np.diff([source.t_ns(index) for index in range(len(source))]) > 0)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(("name", "says"), [("drive.pcap", "damaged after"), ("drive.nmea", "larger than 1024 MiB")])
def test_gigabytes_of_zeros_are_not_read_as_records(name: str, says: str, tmp_path: Path) -> None:
    folder = write_capture(tmp_path / "recording")
    with (folder / name).open("r+b") as file:
        file.truncate(20 << 30)  # takes no space on the disk
    try:
        said = " ".join(open_source(f"pcap:{folder / 'drive.pcap'}").notes)
    except SourceError as error:
        said = str(error)
    assert says in said
