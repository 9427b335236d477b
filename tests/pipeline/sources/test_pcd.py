"""PCD files and folders of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.formats.pcd_file import parse_pcd
from pipeline.sources import SourceError, open_source
from tests.pipeline.formats.velodyne.streams import ring_wall
from tests.pipeline.sources.made.captures import RIG
from tests.pipeline.sources.made.clouds_on_disk import DTYPE, STAMPS_NS, lzf, pcd, rows_of, write_clouds

ENCODINGS = ("ascii", "binary", "binary_compressed")
ROWS = rows_of(ring_wall(0))[::37]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_field_comes_back(encoding: str) -> None:
    notes: list[str] = []
    rows = parse_pcd(pcd(ROWS, encoding), "a.pcd", notes)
    assert rows.dtype == DTYPE
    assert np.array_equal(rows, ROWS)
    assert notes == []


@given(st.lists(st.one_of(st.binary(max_size=300), st.integers(0, 255).map(lambda b: bytes([b]) * 300)), max_size=6))
def test_lzf_of_anything(parts: list[bytes]) -> None:
    data = b"".join(parts)
    data += bytes(-len(data) % 4)
    rows = np.frombuffer(data, np.dtype([("x", "<u4")]))
    if len(rows):
        assert np.array_equal(parse_pcd(pcd(rows, "binary_compressed"), "a.pcd", []), rows)
    assert len(lzf(data)) <= len(data) * 33 // 32 + 1


def test_padding_and_repeated_names_are_room() -> None:
    head = "FIELDS x _ y z x\nSIZE 4 1 4 4 4\nTYPE F U F F F\nCOUNT 1 4 1 1 2\nWIDTH 2\nHEIGHT 1\nDATA binary\n"
    body = np.arange(1, 13, dtype="<f4").tobytes()
    rows = parse_pcd(head.encode() + body, "a.pcd", [])
    assert (rows["x"].tolist(), rows["y"].tolist(), rows["z"].tolist()) == ([1.0, 7.0], [3.0, 9.0], [4.0, 10.0])


WRONG = {
    "empty": (b"", "its header does not end"),
    "not text": (bytes(range(256)) * 40, "not a PCD file"),
    "something else": (b"ply\nformat ascii\n", "not a PCD file"),
    "no points": (pcd(ROWS[:0]), "no points"),
    "unknown type": (pcd(ROWS).replace(b"TYPE F", b"TYPE Q"), "its header is invalid"),
    "too few sizes": (pcd(ROWS).replace(b"SIZE 4 ", b"SIZE "), "its header is invalid"),
    "too many points": (pcd(ROWS).replace(b"POINTS ", b"POINTS 99999999"), "its header is invalid"),
    "unknown encoding": (pcd(ROWS).replace(b"DATA binary", b"DATA zipped"), "its header is invalid"),
    "compressed, cut": (pcd(ROWS, "binary_compressed")[:-50], "truncated or damaged"),
    "compressed, spoiled": (pcd(ROWS, "binary_compressed")[:-50] + bytes([255]) * 50, "compressed points are damaged"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_in_one_sentence(name: str) -> None:
    data, says = WRONG[name]
    with pytest.raises(SourceError, match=rf"a\.pcd: .*{says}"):
        parse_pcd(data, "a.pcd", [])


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_a_cut_file_gives_what_is_there(encoding: str) -> None:
    notes: list[str] = []
    rows = parse_pcd(pcd(ROWS, encoding)[:-60], "a.pcd", notes)
    assert 0 < len(rows) < len(ROWS)
    assert notes == [f"a.pcd: {len(rows)} of {len(ROWS)} points read"]


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_folder(encoding: str, tmp_path: Path) -> None:
    source = open_source(f"pcd:{write_clouds(tmp_path / 'c', encoding)}")
    assert (len(source), source.rate_hz) == (2, 10.0)
    assert source.notes == ("the camera has no calibration: LiDAR and camera are not fused", "no ego speed recorded")
    for index in range(2):
        frame = source.frame(index)
        assert (frame.t_ns, frame.name, frame.notes) == (STAMPS_NS[index], str(STAMPS_NS[index]), ())
        assert frame.sweep is not None
        assert np.median(np.linalg.norm(frame.sweep.points[:, :3], axis=1)) == pytest.approx(10.0 - index, abs=1e-3)
        assert frame.sweep.time_s is not None
        assert frame.image is not None
        assert np.median(frame.image.bgr) == 50 + index
        assert source.truth(index) is None
    with pytest.raises(IndexError):
        source.frame(2)


def test_a_rig_in_the_folder_is_used(tmp_path: Path) -> None:
    folder = write_clouds(tmp_path / "c")
    (folder / "rig.yaml").write_text(RIG)
    frame = open_source(f"pcd:{folder}").frame(0)
    assert frame.camera is not None
    assert frame.sweep is not None
    assert float(np.median(frame.sweep.points[:, 2])) == pytest.approx(1.0, abs=0.3)


def test_names_that_are_no_times_are_ten_a_second(tmp_path: Path) -> None:
    for name in ("000002", "000001"):
        (tmp_path / f"{name}.pcd").write_bytes(pcd(ROWS))
    source = open_source(f"pcd:{tmp_path}")
    assert [source.t_ns(index) for index in range(2)] == [0, 100_000_000]
    assert source.notes[0] == "no timestamps in the file names: 10 Hz assumed"
    assert [source.frame(index).name for index in range(2)] == ["000001", "000002"]


@pytest.mark.parametrize(
    "names",
    [["0", "1", "2", "9", "10", "11"], ["9.5", "10.25", "010.3"], ["a1", "a10", "a2"], ["1", "10", "2", "last"]],
    ids=["numbers", "fractions", "names", "names among numbers"],
)
def test_frames_come_in_order_of_their_numbers(names: list[str], tmp_path: Path) -> None:
    for name in names:
        (tmp_path / f"{name}.pcd").write_bytes(pcd(ROWS[:1]))
    source = open_source(f"pcd:{tmp_path}")
    assert [source.frame(index).name for index in range(len(source))] == names


@pytest.mark.parametrize(
    ("name", "t_ns"),
    [
        ("1700000000.5", 1_700_000_000_500_000_000),
        ("1700000000500", 1_700_000_000_500_000_000),
        ("1700000000500000", 1_700_000_000_500_000_000),
        ("1700000000500000001", 1_700_000_000_500_000_001),
    ],
)
def test_names_that_are_times(name: str, t_ns: int, tmp_path: Path) -> None:
    (tmp_path / f"{name}.pcd").write_bytes(pcd(ROWS))
    assert open_source(f"pcd:{tmp_path}").t_ns(0) == t_ns


def test_names_beyond_64_bits_are_no_times(tmp_path: Path) -> None:
    (tmp_path / "9999999999999999999.pcd").write_bytes(pcd(ROWS))
    assert open_source(f"pcd:{tmp_path}").t_ns(0) == 0


def test_a_damaged_file_degrades_its_frame(tmp_path: Path) -> None:
    folder = write_clouds(tmp_path / "c")
    (folder / f"{STAMPS_NS[0]}.pcd").write_bytes(b"garbage")
    source = open_source(f"pcd:{folder}")
    assert source.frame(0).sweep is None
    assert source.frame(0).notes == (f"{STAMPS_NS[0]}.pcd: not a PCD file: its header does not end",)
    assert source.frame(1).sweep is not None


def test_no_clouds(tmp_path: Path) -> None:
    (tmp_path / "x.txt").write_text("x")
    with pytest.raises(SourceError, match="contains no PCD files"):
        open_source(f"pcd:{tmp_path}")
    (tmp_path / "a.pcd").write_bytes(pcd(ROWS))
    with pytest.raises(SourceError, match=r"rig=other\.yaml: no such file"):
        open_source(f"pcd:{tmp_path}?rig=other.yaml")
    assert len(open_source(str(tmp_path))) == 1


def test_nebula(data_dir: Path, tmp_path: Path) -> None:
    """A file of another program, with its rings and times."""
    name = "nebula_1673400472138016708.pcd"
    (tmp_path / "1673400472138016708.pcd").symlink_to(data_dir / "vlp16_packets" / name)
    frame = open_source(f"pcd:{tmp_path}").frame(0)
    assert frame.t_ns == 1_673_400_472_138_016_708
    assert frame.sweep is not None
    assert len(frame.sweep.points) == 14_831
    elevation = np.degrees(np.arcsin(frame.sweep.points[:, 2] / np.linalg.norm(frame.sweep.points[:, :3], axis=1)))
    assert np.abs(elevation - (2.0 * frame.sweep.ring - 15.0)).max() < 0.1
