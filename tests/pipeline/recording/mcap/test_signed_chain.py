"""A session that was signed says by whom, and that it is no longer so once anybody changed it."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

from app.cli import main
from pipeline.common.errors import BadInput
from pipeline.common.files.signing import SIGNING_VARIABLE, new_keys
from pipeline.recording.mcap.chain import NAME, ChainWriter, verify
from pipeline.recording.mcap.index import MAGIC, summary_start
from pipeline.recording.mcap.reader import McapFile
from pipeline.recording.relabel import relabel
from tests.pipeline.recording.frames import full, write


@pytest.fixture
def key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The public key of the key pair that signs from now on."""
    _, digits = new_keys(tmp_path / "key")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "key"))
    return digits


@pytest.fixture
def signed(key: str, tmp_path: Path) -> Path:
    return write(tmp_path / "a.mcap", [full(index) for index in range(4)])


def test_a_session_is_signed_by_the_key_and_by_no_other(signed: Path, key: str, tmp_path: Path) -> None:
    chain = verify(signed, key=key)
    assert (chain.state, chain.signature.state, chain.signature.key) == ("intact", "signed", key)
    assert chain.is_signed_whole()
    _, other = new_keys(tmp_path / "other")
    assert verify(signed, key=other).signature.state == "does not match"
    assert not verify(signed, key=other).is_signed_whole()


def test_any_bit_that_is_changed_takes_its_signature(signed: Path, key: str) -> None:
    data = signed.read_bytes()
    behind = data.rindex(NAME.encode())  # no hash is over what follows, but for the signature
    assert behind < len(data) - 1000
    for place in (*range(0, behind, len(data) // 30), *range(behind, behind + 450, 7), *range(behind, len(data), 101)):
        changed = bytearray(data)
        changed[place] ^= 1
        signed.write_bytes(changed)
        assert not verify(signed, key=key).is_signed_whole(), place


def test_a_summary_that_calls_a_topic_otherwise_is_found(signed: Path, key: str) -> None:
    data = bytearray(signed.read_bytes())
    with signed.open("rb") as file:
        begin = summary_start(file, len(data))
    footer = len(data) - len(MAGIC) - 4
    data[begin:footer] = data[begin:footer].replace(b"/points", b"/pointz")
    data[footer : footer + 4] = zlib.crc32(data[begin:footer]).to_bytes(4, "little")
    signed.write_bytes(data)
    chain = verify(signed, key=key)
    assert chain.changed == ("the index at its end does not match the data",)
    assert chain.signature.state == "does not match"


def test_who_builds_the_chain_again_cannot_sign_it(
    signed: Path, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(SIGNING_VARIABLE)
    with McapFile(signed) as file:
        assert relabel(file, tmp_path / "forged.mcap", b"{}", 5)
    forged = verify(tmp_path / "forged.mcap", key=key)
    assert (forged.state, forged.signature.state) == ("intact", "not signed")
    new_keys(tmp_path / "theirs")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "theirs"))
    with McapFile(signed) as file:
        assert relabel(file, tmp_path / "again.mcap", b"{}", 5)
    assert verify(tmp_path / "again.mcap", key=key).signature.state == "does not match"


def test_a_last_signature_that_was_copied_from_elsewhere_does_not_match(
    key: str, signed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []
    link = ChainWriter.link

    def keep(self: ChainWriter, *, is_last: bool = False) -> None:
        signer = self._signer
        assert signer is not None
        taken.append(signer.sign(b"x"))
        self._signer = type("Copied", (), {"sign": lambda _, said: taken[0]})()  # type: ignore[assignment]
        link(self, is_last=is_last)
        self._signer = signer

    monkeypatch.setattr(ChainWriter, "link", keep)
    chain = verify(write(tmp_path / "b.mcap", [full(0)]), key=key)
    assert (chain.state, chain.signature.state) == ("changed", "does not match")


def test_one_that_was_cut_is_signed_as_far_as_it_goes_and_not_whole(signed: Path, key: str, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    data = signed.read_bytes()
    cut.write_bytes(data[: data.rindex(NAME.encode()) - 100])
    assert verify(cut, key=key).state in ("cut off", "not chained")
    assert not verify(cut, key=key).is_signed_whole()


def test_without_a_usable_key_no_session_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "none"))
    with pytest.raises(BadInput, match="cannot be read"):
        write(tmp_path / "a.mcap", [full(0)])
    assert not (tmp_path / "a.mcap").exists()


def test_info_says_it(
    signed: Path, key: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def told(*options: object) -> tuple[object, str]:
        with pytest.raises(SystemExit) as end:
            main(["info", *map(str, options)])
        said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("signature: ")]
        return end.value.code, said[0].removeprefix("signature: ") if said else ""

    public = tmp_path / "key.pub"
    assert told(signed, "--public-key", public) == (0, f"signed by {key}")
    code, said = told(signed)
    assert code == 0
    assert said.startswith(f"signed by {key}; use --public-key")
    other, _ = new_keys(tmp_path / "other")
    assert told(signed, "--public-key", other) == (1, "the signature does not match")
    monkeypatch.delenv(SIGNING_VARIABLE)
    plain = write(tmp_path / "plain.mcap", [full(0)])
    assert told(plain) == (0, "not signed")
    assert told(plain, "--public-key", public) == (1, "not signed")
    assert told(signed, "--quick", "--public-key", public)[0] == 2
    assert told("sim:straight", "--public-key", public)[0] == 2
