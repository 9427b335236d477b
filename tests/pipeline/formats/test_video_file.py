"""Images of a video file by their time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.formats.video_file import VideoFile
from pipeline.sources import SourceError
from tests.pipeline.sources.captures import write_video

IMAGES = 12


@pytest.mark.parametrize(("name", "codec"), [("a.avi", "mjpeg"), ("a.mp4", "mpeg4"), ("a.mkv", "mpeg4")])
@pytest.mark.parametrize("order", [range(IMAGES), range(IMAGES - 1, -1, -1), (3, 3, 9, 2, 4, 11, 0)])
def test_every_image_in_any_order(name: str, codec: str, order: range, tmp_path: Path) -> None:
    write_video(tmp_path / name, IMAGES, rate=25, codec=codec)
    video = VideoFile(tmp_path / name)
    assert video.times_ns == pytest.approx(np.arange(IMAGES) * 40e6, abs=1e6)
    for index in order:
        image = video.image(index)
        assert image.shape == (48, 80, 3)
        assert np.median(image) == pytest.approx(20 * index, abs=8)


@pytest.mark.parametrize("data", [b"", b"garbage" * 100, b"RIFF....AVI LIST"])
def test_no_video(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.avi").write_bytes(data)
    with pytest.raises(SourceError, match=r"a\.avi: not a readable video"):
        VideoFile(tmp_path / "a.avi")


def test_a_video_that_goes_away(tmp_path: Path) -> None:
    write_video(tmp_path / "a.avi", 3)
    video = VideoFile(tmp_path / "a.avi")
    (tmp_path / "a.avi").unlink()
    with pytest.raises(SourceError, match=r"a\.avi: image 1 cannot be decoded"):
        video.image(1)


def test_two_who_read_by_turns_do_not_make_each_other_seek(tmp_path: Path) -> None:
    write_video(tmp_path / "a.mkv", 100, rate=25, codec="mpeg4", step=2)
    told: list[tuple[int, int]] = []
    video = VideoFile(tmp_path / "a.mkv", lambda done, total: told.append((done, total)))
    assert told
    assert all(0 <= done < total == (tmp_path / "a.mkv").stat().st_size for done, total in told)
    for index in range(20):
        for at in (index, index + 80):
            assert np.median(video.image(at)) == pytest.approx(2 * at, abs=8)
    assert sum(place.seeks for place in video._places) == 2
