"""Files for HTTPS that cannot be used: the error names the file and what is wrong with it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from app.web.tls_files import TlsFiles
from pipeline.common.errors import BadInput
from tests.app.web.serving import certificate


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A certificate, its key, the key with a password, another key, and files that are neither."""
    folder, other = tmp_path_factory.mktemp("own"), tmp_path_factory.mktemp("other")
    cert, key = certificate(folder)
    made = {"cert": cert, "key": key, "other key": certificate(other)[1], "missing": folder / "missing.pem"}
    made["locked"], made["noise"], made["cut"] = (folder / name for name in ("locked.pem", "noise.pem", "cut.pem"))
    subprocess.run(
        ["openssl", "pkey", "-in", key, "-aes256", "-passout", "pass:x", "-out", made["locked"]],
        check=True,
        capture_output=True,
    )
    made["noise"].write_bytes(bytes(range(256)))
    made["cut"].write_bytes(key.read_bytes()[:80])
    return made


def test_a_certificate_and_its_key_are_used(files: dict[str, Path]) -> None:
    TlsFiles(files["cert"], files["key"]).context()


@pytest.mark.parametrize(
    ("cert", "key", "of", "reason"),
    [
        ("cert", "other key", "other key", "is not the key of the certificate in"),
        ("cert", "locked", "locked", "the key needs a password"),
        ("cert", "noise", "noise", "holds no private key in PEM format"),
        ("cert", "cut", "cut", "holds no private key in PEM format"),
        ("cert", "cert", "cert", "holds no private key in PEM format"),
        ("cert", "missing", "missing", "No such file"),
        ("missing", "key", "missing", "No such file"),
        ("noise", "key", "noise", "holds no certificate in PEM format"),
        ("key", "cert", "key", "are --tls-cert and --tls-key swapped?"),
    ],
)
def test_what_is_wrong_is_said_of_the_file(files: dict[str, Path], cert: str, key: str, of: str, reason: str) -> None:
    with pytest.raises(BadInput) as error:
        TlsFiles(files[cert], files[key]).context()
    assert str(error.value).startswith(f"{files[of]}: ")
    assert reason in str(error.value)
