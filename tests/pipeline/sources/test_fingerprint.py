"""A fingerprint is another when, and only when, a file of the recording is another."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.recording.save import save
from pipeline.sources import open_source
from pipeline.sources.fingerprint import content_key, fingerprint
from pipeline.types import CameraImage, Frame
from tests.app.engine.recording_helpers import Recording


def _edit(path: Path) -> None:
    path.write_text("other words")


def _touch_later(path: Path) -> None:
    os.utime(path, ns=(2 * 10**18, 2 * 10**18))


def _replace(path: Path) -> None:
    """Replace a file by another one of the same size and time."""
    times = path.stat()
    other = path.with_name("other.tmp")
    other.write_text("x" * times.st_size)
    os.utime(other, ns=(times.st_atime_ns, times.st_mtime_ns))
    other.replace(path)


@pytest.mark.parametrize("change", [_edit, _touch_later, _replace])
@pytest.mark.parametrize(
    ("uri", "changed"),
    [
        ("sim:{}/my.yaml", "my.yaml"),
        ("{}/drive.mcap", "drive.mcap"),
        ("mcap:{}/drive.mcap", "drive.mcap"),
        ("pcap:{}/drive.pcap", "drive.mp4"),
        ("pcap:{}/drive.pcap?video=elsewhere.avi", "elsewhere.avi"),
        ("pcd:{}/clouds", "clouds/image_02/000001.png"),
        ("pcd:{}/clouds?rig=mine.yaml", "clouds/mine.yaml"),
    ],
)
def test_an_edited_or_replaced_recording_is_another(
    tmp_path: Path, uri: str, changed: str, change: Callable[[Path], None]
) -> None:
    names = ["my.yaml", "drive.mcap", "drive.pcap", "drive.mp4", "elsewhere.avi", "clouds/1.pcd", "clouds/mine.yaml"]
    for name in [*names, "clouds/image_02/000001.png"]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("words")
    uri = uri.format(tmp_path)
    before = fingerprint(uri)
    assert fingerprint(uri) == before
    (tmp_path / "unrelated.txt").write_text("words")
    assert fingerprint(uri) == before
    change(tmp_path / changed)
    assert fingerprint(uri) != before


@pytest.mark.parametrize("uri", ["sim:straight", "mcap:/no/such.mcap", "pcd:~nobody-here/x", "", "a\0b:\0", "sim:"])
def test_what_names_no_file_has_one_too(uri: str) -> None:
    assert fingerprint(uri) == fingerprint(uri)
    assert fingerprint(uri) != fingerprint(uri + "x")


def key(source: Recording) -> str:
    return content_key([source.t_ns(index) for index in range(len(source))], source.frame)


def test_a_recording_has_the_same_key_wherever_it_lies_and_whatever_form_it_has(tmp_path: Path) -> None:
    recording = Recording(count=5)
    save(recording, tmp_path / "drive.mcap")
    session = open_source(str(tmp_path / "drive.mcap"))
    assert key(session) == key(recording) == key(Recording("test:elsewhere", count=5))  # type: ignore[arg-type]


def test_another_recording_has_another_key() -> None:
    class Darker(Recording):
        """A recording with another first image."""

        def frame(self, index: int) -> Frame:
            frame = super().frame(index)
            assert frame.image is not None
            return frame if index else replace(frame, image=CameraImage(frame.t_ns, frame.image.bgr // 2))

    class Later(Recording):
        """The same recording at another time."""

        def t_ns(self, index: int) -> int:
            return super().t_ns(index) + 1

    assert len({key(each) for each in (Recording(count=5), Recording(count=6), Darker(count=5), Later(count=5))}) == 4


class Sensed(Recording):
    """A recording whose LiDAR measures intensity, as a real one does."""

    def frame(self, index: int) -> Frame:
        frame = super().frame(index)
        assert frame.sweep is not None
        points = frame.sweep.points.copy()
        points[:, 3] = np.random.default_rng(index).integers(0, 255, len(points))
        return replace(frame, sweep=replace(frame.sweep, points=points))


def test_neither_a_mount_nor_a_video_beside_it_makes_it_another(tmp_path: Path) -> None:
    class Mounted(Sensed):
        """A recording whose camera was found to face slightly to the left."""

        def frame(self, index: int) -> Frame:
            frame = super().frame(index)
            assert frame.sweep is not None
            points = frame.sweep.points + np.array([0.0, 0.1, 0.0, 0.0], np.float32)
            return replace(frame, sweep=replace(frame.sweep, points=points))

    class Blind(Sensed):
        def frame(self, index: int) -> Frame:
            return replace(super().frame(index), image=None)

    class Elsewhere(Sensed):
        """A recording of another scene at the same times."""

        def frame(self, index: int) -> Frame:
            return super().frame(index + 1)

    save(Sensed(count=5), tmp_path / "drive.mcap")
    same = [Sensed(count=5), Mounted(count=5), Blind(count=5), open_source(str(tmp_path / "drive.mcap"))]
    assert len({key(each) for each in same}) == 1  # type: ignore[arg-type]
    assert key(Elsewhere(count=5)) != key(same[0])  # type: ignore[arg-type]


def test_without_images_the_points_tell_recordings_apart() -> None:
    def blind(index: int) -> Frame:
        return replace(Recording().frame(index), image=None)

    assert content_key([1, 2], blind) != content_key([1, 2], lambda index: blind(index + 3))
    assert content_key([], blind) == content_key([], blind)
