"""Cut or changed anywhere, a session is read as far as it goes, or refused in one sentence."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import BadInput
from pipeline.recording.info import info
from pipeline.recording.mcap import output as mcap_output
from pipeline.recording.rewrite import recover
from pipeline.recording.session.source import SessionSource
from pipeline.sources import SourceError
from tests.pipeline.recording.frames import full, same, sweep, write

FRAMES = 12
MUTATIONS = 60


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A session of several chunks."""
    frames = [replace(full(index), sweep=sweep(index, points=1500)) for index in range(FRAMES)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_output, "CHUNK_BYTES", 64 * 1024)
        path = write(tmp_path_factory.mktemp("whole") / "a.mcap", frames)
    assert len(SessionSource("a", str(path)).file.directory.chunks) >= 5
    return path.read_bytes()


def read_all(path: Path) -> int:
    """Read every frame with all its data; returns the number of frames."""
    session = SessionSource("a", str(path))
    for index in range(len(session)):
        frame = session.frame(index)
        assert frame.index == index
        session.truth(index), session.params(index), session.result(index)
    session.marks()
    info(path)
    return len(session)


def frames_or_refusal(path: Path) -> int | str:
    """Number of readable frames, or the sentence that says why there are none."""
    try:
        return read_all(path)
    except SourceError as error:
        return str(error)


def test_cut_at_any_byte(whole: bytes, tmp_path: Path) -> None:
    path, before = tmp_path / "a.mcap", 0
    for length in np.linspace(0, len(whole) - 1, 60).astype(int):
        path.write_bytes(whole[:length])
        found = frames_or_refusal(path)
        frames = 0 if isinstance(found, str) else found
        assert isinstance(found, int) or str(path) in found
        assert frames >= before, "more of the file must never hold less"
        before = frames
    assert before == FRAMES


@pytest.mark.parametrize("where", ["beginning", "end"])
def test_cut_at_every_byte_of_its(where: str, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    for length in range(0, 90) if where == "beginning" else range(len(whole) - 60, len(whole)):
        path.write_bytes(whole[:length])
        assert isinstance(frames_or_refusal(path), str if where == "beginning" else int)


@pytest.mark.parametrize("where", ["anywhere", "summary"])
def test_bytes_changed(where: str, whole: bytes, tmp_path: Path) -> None:
    """Single bits, runs of noise, and lengths that claim the impossible."""
    random = np.random.default_rng(1)
    path, refused = tmp_path / "a.mcap", 0
    for trial in range(MUTATIONS):
        data = np.frombuffer(whole, np.uint8).copy()
        at = int(random.integers(0 if where == "anywhere" else len(data) - 4000, len(data)))
        length = int(random.choice([1, 1, 8, 64, 1000]))
        noise = random.integers(0, 256, length) if random.random() < 0.7 else np.full(length, 255)
        data[at : at + length] = noise[: len(data) - at]
        path.write_bytes(data.tobytes())
        found = frames_or_refusal(path)
        refused += isinstance(found, str)
        assert isinstance(found, int) or "\n" not in found
        if trial % 8 == 0:
            out = tmp_path / f"{trial}.mcap"
            with suppress(BadInput):
                recover(path, out)
                assert read_all(out) if isinstance(found, int) else True
    assert refused < MUTATIONS / 10, "a session must survive most of such damage"


def test_one_flipped_bit_costs_one_part_of_the_drive(whole: bytes, tmp_path: Path) -> None:
    """Each chunk has a checksum: damaged data is reported and not shown; the rest is unaffected."""
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    chunk = SessionSource("a", str(path)).file.directory.chunks[2]
    data = bytearray(whole)
    data[chunk.offset + chunk.length // 2] ^= 1
    path.write_bytes(bytes(data))
    session = SessionSource("a", str(path))
    frames = [session.frame(index) for index in range(FRAMES)]
    hurt = [frame for frame in frames if frame.sweep is None]
    assert 0 < len(hurt) < FRAMES / 2
    assert all(any("lacks a message" in note for note in frame.notes) for frame in hurt)
    assert all(same(frame.image, full(frame.index).image) for frame in frames if frame not in hurt)


def test_recovering_a_cut_file_keeps_every_complete_chunk(whole: bytes, tmp_path: Path) -> None:
    path, out = tmp_path / "a.mcap", tmp_path / "out.mcap"
    path.write_bytes(whole)
    chunks = SessionSource("a", str(path)).file.directory.chunks
    for kept in range(1, len(chunks)):
        path.write_bytes(whole[: chunks[kept].offset + chunks[kept].length - 1])  # all but the last byte of the next
        out.unlink(missing_ok=True)
        saved = recover(path, out)
        assert (saved.chunks, saved.lost_chunks, saved.is_cut) == (kept, 0, True)
        session = SessionSource("a", str(out))
        assert session.file.directory.problem is None
        assert len(session) == saved.frames == read_all(path)
        assert same(session.frame(len(session) - 1).image, full(len(session) - 1).image)


def test_recovering_a_whole_file_loses_nothing(whole: bytes, tmp_path: Path) -> None:
    path, out = tmp_path / "a.mcap", tmp_path / "out.mcap"
    path.write_bytes(whole)
    saved = recover(path, out)
    assert (saved.frames, saved.lost_chunks, saved.is_cut) == (FRAMES, 0, False)
    with pytest.raises(BadInput, match="already"):
        recover(path, out)
    with pytest.raises(BadInput):
        recover(path, path)
    assert path.read_bytes() == whole


def test_nothing_is_written_when_there_is_nothing_to_recover(whole: bytes, tmp_path: Path) -> None:
    path, out = tmp_path / "a.mcap", tmp_path / "out.mcap"
    path.write_bytes(whole)
    first = SessionSource("a", str(path)).file.directory.chunks[0]
    path.write_bytes(whole[: first.offset + first.length - 1])
    with pytest.raises(SourceError, match=r"a.mcap: the session holds no frames: it was cut off before the first$"):
        SessionSource("a", str(path))
    with pytest.raises(BadInput, match=r"a.mcap: no complete chunk: nothing can be recovered$"):
        recover(path, out)
    assert not out.exists()
