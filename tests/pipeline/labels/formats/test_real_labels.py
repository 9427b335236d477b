"""The labels that come with Astyx and KITTI, out and back."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.labels.boxes import following
from pipeline.labels.formats.base import LabeledDrive, drive_of
from pipeline.labels.formats.registry import export_labels, import_labels
from pipeline.labels.recorded_truth import LINKED, truth_labels
from pipeline.recording.save import save
from pipeline.sources import open_source
from tests.pipeline.labels.formats.sets import IMPORT, assert_same


@pytest.fixture(scope="module")
def kitti(data_dir: Path) -> tuple[Path, LabeledDrive]:
    folder = data_dir / "kitti_0052"
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    return folder, drive_of(open_source(f"kitti:{folder}"))


@pytest.fixture(scope="module")
def astyx(data_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, LabeledDrive]:
    """Every fourth frame of the recording."""
    whole, part = data_dir / "astyx", tmp_path_factory.mktemp("astyx")
    if not whole.is_dir():
        pytest.skip(f"no Astyx recording at {whole}")
    names = sorted(path.stem for path in (whole / "lidar_vlp16").iterdir())[::4]
    for kind in ("lidar_vlp16", "camera_front", "calibration", "groundtruth_obj3d"):
        (part / kind).mkdir()
        for path in (whole / kind).iterdir():
            if path.stem in names:
                (part / kind / path.name).symlink_to(path)
    uri = f"astyx:{part}"
    return uri, drive_of(open_source(uri))


def test_kitti_lines_are_what_they_were(kitti: tuple[Path, LabeledDrive], tmp_path: Path) -> None:
    """Everything except what labels do not store, such as the class van."""
    folder, drive = kitti
    found = import_labels(folder / "label_2", drive, "kitti", IMPORT)
    sightings = [each for track in found.labels.tracks for each in track.sightings]
    regions = [track for track in found.labels.tracks if track.label == "dont care"]
    assert (len(found.labels.tracks) - len(regions), len(sightings)) == (8, 24 + len(regions))
    assert len(regions) > 3, "regions of which KITTI says nothing"
    assert None not in [each.bbox for each in sightings]
    assert "9 Van are read as class 'car'" in found.notes
    export_labels(found.labels, drive, "kitti", tmp_path / "out")
    for path in sorted((folder / "label_2").iterdir()):
        theirs = [line.split() for line in path.read_text().splitlines()]
        ours = [line.split() for line in (tmp_path / "out/label_2" / path.name).read_text().splitlines()]
        for lines in (ours, theirs):  # ours are by track
            lines.sort(key=lambda line: float(line[4]))
        assert [line[0] for line in ours] == [line[0].replace("Van", "Car") for line in theirs]
        for mine, yours in zip(ours, theirs, strict=True):
            assert [f"{float(v):.2f}" for v in mine[4:]] == [f"{float(v):.2f}" for v in yours[4:]]
            assert [float(v) for v in mine[1:3]] == [float(v) for v in yours[1:3]], "cut and hidden as far"
            if yours[1] == "0.00":  # of a cut object KITTI has the angle to what is seen of it
                assert float(mine[3]) == pytest.approx(float(yours[3]), abs=0.03)
    again = import_labels(tmp_path / "out", drive, "kitti", IMPORT)
    assert_same(again.labels, found.labels)


def test_the_truth_of_a_kitti_recording_is_what_its_label_files_say(
    kitti: tuple[Path, LabeledDrive], tmp_path: Path
) -> None:
    """Image boxes, identities and original classes, also after conversion to a session."""
    folder, drive = kitti
    found = import_labels(folder / "label_2", drive, "kitti", IMPORT)
    source = open_source(f"kitti:{folder}")
    save(source, tmp_path / "drive.mcap", 0, len(source) - 1)
    for uri in (f"kitti:{folder}", str(tmp_path / "drive.mcap")):
        labels, notes = truth_labels(open_source(uri), drive.frames, IMPORT)
        assert labels.tracks == tuple(track for track in found.labels.tracks if track.label != "dont care")
        assert set(notes) & set(found.notes) == {LINKED, "9 Van are read as class 'car'"}
    lost = export_labels(labels, drive_of(open_source(uri)), "kitti", tmp_path / "out")
    assert not any("no box" in each for each in lost)


def test_kitti_export_opens_as_a_kitti_recording_with_the_same_truth(
    kitti: tuple[Path, LabeledDrive], tmp_path: Path
) -> None:
    folder, drive = kitti
    labels = import_labels(folder / "label_2", drive, "kitti", IMPORT).labels
    export_labels(labels, drive, "kitti", tmp_path / "out")
    (tmp_path / "out/velodyne").symlink_to(folder / "velodyne")
    (tmp_path / "out/image_02").symlink_to(folder / "image_02")
    ours, theirs = open_source(f"kitti:{tmp_path / 'out'}"), open_source(f"kitti:{folder}")
    for index in (7, 14, 21):
        mine, yours = ours.truth(index) or (), theirs.truth(index) or ()
        assert [each.label for each in mine] == [each.label for each in yours]
        for one, other in zip(mine, yours, strict=True):
            assert one.cuboid.center == pytest.approx(other.cuboid.center, abs=1e-5)
            assert one.cuboid.yaw_rad == pytest.approx(other.cuboid.yaw_rad, abs=1e-5)


@pytest.mark.parametrize("name", ["kitti", "kitti-tracking", "nuscenes", "openlabel", "native"])
def test_astyx_truth_comes_back(astyx: tuple[str, LabeledDrive], name: str, tmp_path: Path) -> None:
    uri, drive = astyx
    labels, notes = truth_labels(open_source(uri), drive.frames, IMPORT)
    assert len(labels.tracks) > 20
    assert any("linked from frame to frame by distance" in note for note in notes)
    export_labels(labels, drive, name, tmp_path / "out")  # type: ignore[arg-type]
    back = import_labels(tmp_path / "out", drive, name, IMPORT)  # type: ignore[arg-type]
    wanted = following(labels, drive) if name in ("kitti", "kitti-tracking", "openlabel") else labels
    assert_same(back.labels, wanted, 1e-5)


def test_the_tracking_benchmarks_own_file_is_read(data_dir: Path) -> None:
    """In its regions, missing numbers are in another order than in the object benchmark."""
    folder = data_dir / "kitti_0009"
    if not folder.is_dir():
        pytest.skip(f"no KITTI drive at {folder}")
    drive = drive_of(open_source(f"kitti:{folder / '2011_09_26' / '2011_09_26_drive_0009_sync'}"))
    rows = [line.split() for line in (folder / "label_02.txt").read_text(encoding="utf-8").splitlines()]
    found = import_labels(folder / "label_02.txt", drive, "kitti-tracking", IMPORT).labels
    placed = [track for track in found.tracks if track.sightings[0].cuboid is not None]
    regions = [track for track in found.tracks if track.sightings[0].cuboid is None]
    assert sorted(track.id for track in placed) == sorted({int(row[1]) for row in rows if row[2] != "DontCare"})
    assert len(regions) == sum(row[2] == "DontCare" for row in rows)
