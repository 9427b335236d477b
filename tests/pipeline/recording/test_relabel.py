"""Labels put into a session: everything else is as it was, byte by byte, and any reader opens it."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader

from pipeline.common.errors import BadInput
from pipeline.recording import topics
from pipeline.recording.drawn_labels import Drawn
from pipeline.recording.mcap import output as mcap_output
from pipeline.recording.mcap.reader import McapFile, Stored
from pipeline.recording.relabel import relabel
from pipeline.recording.rewrite import clip
from pipeline.recording.save import save
from pipeline.recording.session.source import SessionSource
from pipeline.recording.session.writer import SessionWriter
from tests.pipeline.recording.frames import ABOUT, full, same

FRAMES = 12


def drive(path: Path, labels_at: int | None = None) -> Path:
    """A session of several chunks, with labels after one of its frames."""
    writer = SessionWriter(path, ABOUT)
    for index in range(FRAMES):
        writer.write(full(index), {"frame": index})
        if index == labels_at:
            writer.write_labels(b'{"old": 1}')
            writer.write_mark("after the labels")
    writer.close()
    return path


@pytest.fixture(autouse=True)
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_output, "CHUNK_BYTES", 5_000)


def messages(path: Path) -> list[Stored]:
    with McapFile(path) as file:
        assert file.directory.problem is None
        return list(file.messages())


@pytest.mark.parametrize("labels_at", [None, 4, FRAMES - 1], ids=["none before", "in the middle", "at the end"])
def test_it_holds_what_a_copy_message_by_message_holds(labels_at: int | None, tmp_path: Path) -> None:
    source = SessionSource("", str(drive(tmp_path / "a.mcap", labels_at)))
    assert len(source.file.directory.chunks) > 3
    assert relabel(source.file, tmp_path / "b.mcap", b'{"new": 2}', source.t_ns(FRAMES - 1))
    clip(source, 0, FRAMES - 1, tmp_path / "c.mcap", b'{"new": 2}')
    assert messages(tmp_path / "b.mcap") == messages(tmp_path / "c.mcap")
    back = SessionSource("", str(tmp_path / "b.mcap"))
    assert back.labels() == b'{"new": 2}'
    assert all(same(back.frame(index), source.frame(index)) for index in range(FRAMES))
    assert [each.name for each in back.outlines()] == [each.name for each in source.outlines()]
    assert (back.origin, back.title, back.notes) == (source.origin, source.title, source.notes)


def test_labels_take_the_place_of_labels_again_and_again(tmp_path: Path) -> None:
    path = drive(tmp_path / "0.mcap")
    for turn in range(1, 4):
        source = SessionSource("", str(path))
        path = tmp_path / f"{turn}.mcap"
        save(source, path, labels=b"%d" % turn)
    assert [stored.data for stored in messages(path) if stored.channel.topic == topics.LABELS] == [b"3"]
    assert len(messages(path)) == len(messages(tmp_path / "1.mcap"))


@pytest.mark.parametrize("labels_at", [None, 4], ids=["copied bytes", "copied messages"])
def test_what_viewers_show_takes_the_place_of_what_they_showed(labels_at: int | None, tmp_path: Path) -> None:
    path = drive(tmp_path / "0.mcap", labels_at)
    for turn in (b"first", b"second"):
        source = SessionSource("", str(path))
        path = tmp_path / f"{turn.decode()}.mcap"
        drawn = {at: [Drawn(topics.LABEL_SCENE, turn), Drawn(topics.LABEL_IMAGE, turn)] for at in (3, 4, FRAMES - 1)}
        save(source, path, labels=turn, drawn=drawn)
    back = SessionSource("", str(path))
    shown = [each for each in messages(path) if each.channel.topic in (topics.LABEL_SCENE, topics.LABEL_IMAGE)]
    assert {each.data for each in shown} == {b"second"}
    at_frames = {(each.channel.topic, each.log_time_ns, each.publish_time_ns) for each in shown}
    assert at_frames == {
        (topic, back.log_time_ns(at), back.t_ns(at))
        for topic in (topics.LABEL_SCENE, topics.LABEL_IMAGE)
        for at in (3, 4, FRAMES - 1)
    }
    assert all(same(back.frame(index), full(index)) for index in range(FRAMES))
    clip(back, 2, 5, tmp_path / "clip.mcap")
    kept = [each for each in messages(tmp_path / "clip.mcap") if each.channel.topic == topics.LABEL_SCENE]
    assert len(kept) == 2, "a clip keeps what its frames show"


def test_the_library_s_own_reader_finds_everything_by_the_index(tmp_path: Path) -> None:
    source = SessionSource("", str(drive(tmp_path / "a.mcap", 5)))
    assert relabel(source.file, tmp_path / "b.mcap", b"{}", 0)
    with (tmp_path / "b.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        found = [(channel.topic, message.log_time, message.data) for _, channel, message in reader.iter_messages()]
        names = {each.name for each in reader.iter_attachments()}
    assert sorted(found) == sorted(
        (each.channel.topic, each.log_time_ns, each.data) for each in messages(tmp_path / "b.mcap")
    )
    assert names == {topics.INDEX, topics.TICKS}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(found)
    assert sum(summary.statistics.channel_message_counts.values()) == len(found)
    assert summary.statistics.chunk_count == len(summary.chunk_indexes)


def test_the_chunks_before_the_labels_are_copied_unread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = SessionSource("", str(drive(tmp_path / "a.mcap")))
    monkeypatch.setattr(source.file, "chunk", lambda place: pytest.fail("a chunk was unpacked"))
    assert relabel(source.file, tmp_path / "b.mcap", b"{}", 0)
    end = source.file.directory.chunks[-1].offset
    assert (tmp_path / "b.mcap").read_bytes()[:end] == (tmp_path / "a.mcap").read_bytes()[:end]


def test_a_session_that_was_cut_off_is_copied_message_by_message(tmp_path: Path) -> None:
    whole = drive(tmp_path / "a.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 3 // 4])
    source = SessionSource("", str(cut))
    assert not relabel(source.file, tmp_path / "b.mcap", b"{}", 0)
    assert not (tmp_path / "b.mcap").exists()
    save(source, tmp_path / "b.mcap", labels=b"{}")
    assert SessionSource("", str(tmp_path / "b.mcap")).labels() == b"{}"


def test_a_file_that_is_there_is_kept(tmp_path: Path) -> None:
    source = SessionSource("", str(drive(tmp_path / "a.mcap")))
    (tmp_path / "b.mcap").write_text("mine")
    with pytest.raises(BadInput, match="already"):
        save(source, tmp_path / "b.mcap", labels=b"{}")
    assert (tmp_path / "b.mcap").read_text() == "mine"


def test_nothing_stays_behind_of_what_could_not_be_made(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    source = SessionSource("", str(drive(tmp_path / "a.mcap")))
    with pytest.raises(KeyboardInterrupt):
        relabel(source.file, tmp_path / "b.mcap", b"{}", 0, stop)
    assert not (tmp_path / "b.mcap").exists()
