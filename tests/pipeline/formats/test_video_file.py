"""Images of a video file by their time."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest

from pipeline.formats import video_file
from pipeline.formats.video_file import VideoFile
from pipeline.sources import SourceError
from tests.pipeline.sources.made.captures import write_video

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


@pytest.mark.parametrize("name", ["a.ts", "a.m2ts", "a.mpg"])
def test_a_format_without_an_index_gives_the_image_that_was_asked_for(name: str, tmp_path: Path) -> None:
    """A place in such a file need not be that of a key image, and the next one would be up to ten images later."""
    write_video(tmp_path / name, 100, rate=25, codec="mpeg2video", step=2, gop=10)
    in_order = VideoFile(tmp_path / name)
    images = [in_order.image(index) for index in range(len(in_order.times_ns))]
    assert len(images) == 100
    for index in (99, 87, 55, 18, 3, 0):
        assert np.array_equal(VideoFile(tmp_path / name).image(index), images[index]), index


@pytest.mark.parametrize("data", [b"", b"garbage" * 100, b"RIFF....AVI LIST"])
def test_no_video(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.avi").write_bytes(data)
    with pytest.raises(SourceError, match=r"a\.avi: not a readable video"):
        VideoFile(tmp_path / "a.avi")


@pytest.mark.timeout(120)
def test_gigabytes_of_zeros_after_a_video_are_not_searched_to_their_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    write_video(tmp_path / "a.avi", IMAGES)
    with open(tmp_path / "a.avi", "r+b") as file:
        file.truncate(1 << 40)
    monkeypatch.setattr(video_file, "PATIENCE_S", 0.5)
    assert len(VideoFile(tmp_path / "a.avi").times_ns) == IMAGES


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


@pytest.mark.parametrize("codec", ["mjpeg", "mpeg4"])
def test_images_larger_than_a_cameras_are_refused_before_they_are_decoded(
    codec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """48 × 80 pixels are too large for a budget of one pixel less."""
    write_video(tmp_path / "a.avi", 3, codec=codec)
    monkeypatch.setattr(video_file, "MOST_PIXELS", 100_000)  # FFmpeg counts a margin of 128 pixels too
    assert VideoFile(tmp_path / "a.avi").image(1).shape == (48, 80, 3)
    monkeypatch.setattr(video_file, "MOST_PIXELS", 48 * 80 - 1)
    with pytest.raises(SourceError, match=r"a\.avi: "):
        VideoFile(tmp_path / "a.avi").image(1)


PLAYLISTS = {
    "HLS": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{url}\n#EXT-X-ENDLIST\n",
    "DASH": '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011" type="static" '
    'mediaPresentationDuration="PT1S"><Period><AdaptationSet mimeType="video/mp4"><Representation id="1" '
    'bandwidth="1" codecs="avc1"><BaseURL>{url}</BaseURL></Representation></AdaptationSet></Period></MPD>',
    "FFmpeg's list": "ffconcat version 1.0\nfile '{url}'\n",
}


@pytest.mark.parametrize("kind", PLAYLISTS)
def test_what_a_playlist_names_is_neither_fetched_nor_read(kind: str, tmp_path: Path) -> None:
    write_video(tmp_path / "other.avi", 3)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        for url in (f"http://127.0.0.1:{listener.getsockname()[1]}/a.ts", "other.avi"):
            (tmp_path / "a.ts").write_text(PLAYLISTS[kind].format(url=url))
            with pytest.raises(SourceError, match="not a readable video"):
                VideoFile(tmp_path / "a.ts")
        with pytest.raises(BlockingIOError):
            listener.accept()
