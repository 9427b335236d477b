"""Keys are made once and kept from others; a signature is of one key and one content."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from app.cli import main
from pipeline.common.errors import BadInput
from pipeline.common.files.signing import (
    SIGNING_VARIABLE,
    Signature,
    SignatureCheck,
    check_signature,
    configured_signer,
    expected_key,
    new_keys,
)


def test_a_private_key_is_of_its_owner_and_never_written_over(tmp_path: Path) -> None:
    public, digits = new_keys(tmp_path / "a")
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o600
    assert expected_key(public) == digits
    before = (tmp_path / "a").read_bytes(), public.read_bytes()
    for missing in ("a", "a.pub"):  # one of the two that is left is not replaced either
        with pytest.raises(BadInput, match="file already exists"):
            new_keys(tmp_path / "a")
        assert ((tmp_path / "a").read_bytes(), public.read_bytes()) == before
        (tmp_path / missing).rename(tmp_path / "aside")
        with pytest.raises(BadInput, match="file already exists"):
            new_keys(tmp_path / "a")
        (tmp_path / "a").unlink(missing_ok=missing == "a")
        (tmp_path / "aside").rename(tmp_path / missing)
        (tmp_path / "a").write_bytes(before[0])


def test_openssl_reads_the_keys(tmp_path: Path) -> None:
    public, digits = new_keys(tmp_path / "a")
    asked = ["openssl", "pkey", "-pubin", "-in", str(public), "-outform", "DER"]
    try:
        told = subprocess.run(asked, capture_output=True, check=True).stdout
    except FileNotFoundError:
        pytest.skip("openssl is not here")
    assert told[-32:].hex() == digits


def test_a_signature_is_of_one_content_and_one_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _, digits = new_keys(tmp_path / "a")
    _, other = new_keys(tmp_path / "b")
    monkeypatch.setenv(SIGNING_VARIABLE, str(tmp_path / "a"))
    signer = configured_signer()
    assert signer is not None
    signature = signer.sign(b"this")
    assert check_signature(signature, b"this", None) == SignatureCheck("signed", digits, False)
    assert check_signature(signature, b"this", digits) == SignatureCheck("signed", digits, True)
    assert check_signature(None, b"this", digits) == SignatureCheck("not signed")
    for wrong in (signature, Signature(other, signature.value), Signature("", "x"), Signature(digits, "00" * 64)):
        assert check_signature(wrong, b"that", None).state == "does not match"
    assert check_signature(signature, b"this", other).state == "does not match"
    assert "--public-key" in str(check_signature(signature, b"this", None))
    assert str(check_signature(signature, b"this", digits)) == f"signed by {digits}"


def test_a_key_that_cannot_be_used_is_said_and_nothing_is_written_unsigned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    public, _ = new_keys(tmp_path / "a")
    monkeypatch.delenv(SIGNING_VARIABLE, raising=False)
    assert configured_signer() is None
    for file, said in (
        (tmp_path / "none", "cannot be read"),
        (public, "others may read"),
        (Path("/dev/zero"), "regular"),
    ):
        monkeypatch.setenv(SIGNING_VARIABLE, str(file))
        with pytest.raises(BadInput, match=said):
            configured_signer()
    public.chmod(0o600)
    monkeypatch.setenv(SIGNING_VARIABLE, str(public))
    with pytest.raises(BadInput, match="not a private key"):
        configured_signer()
    with pytest.raises(BadInput, match="not a public key"):
        expected_key(tmp_path / "a")


def test_the_command_makes_and_shows_a_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (("new", tmp_path / "a"), ("show", tmp_path / "a.pub")):
        with pytest.raises(SystemExit) as end:
            main(["keys", *map(str, words)])
        assert end.value.code == 0
    digits = expected_key(tmp_path / "a.pub")
    assert digits is not None
    told = capsys.readouterr().out.splitlines()
    assert digits in told[1]
    assert told[-1] == digits
    with pytest.raises(SystemExit) as end:
        main(["keys", "new", str(tmp_path / "a")])
    assert end.value.code == 2
