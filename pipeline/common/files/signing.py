"""Signatures (Ed25519, RFC 8032) of what is chained by hash: sessions and frozen label versions.

``CIPV_SIGNING_KEY`` names the file of a private key, with which everything that is written from then on is signed.
``CIPV_PUBLIC_KEY`` names that of the public key that signatures must be of. Both are PEM, as OpenSSL reads them. The
package ``cryptography`` comes with the extra ``fleet`` or ``signing``, and is imported on use.
"""

from __future__ import annotations

import os
import stat
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Literal, NamedTuple

from pipeline.common.errors import BadInput
from pipeline.common.files.output_files import ensure_new
from pipeline.common.files.user_file_errors import given_path, reason_of
from pipeline.common.files.user_files import read_regular

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

SIGNING_VARIABLE, PUBLIC_VARIABLE = "CIPV_SIGNING_KEY", "CIPV_PUBLIC_KEY"
_LARGEST_KEY = 16 << 10
_OTHERS = stat.S_IRWXG | stat.S_IRWXO
SignatureState = Literal["not signed", "signed", "does not match"]


class Signature(NamedTuple):
    """A signature as stored; both fields are hexadecimal."""

    key: str
    """The public key, 32 bytes."""
    value: str
    """The signature, 64 bytes."""


@dataclass(frozen=True)
class SignatureCheck:
    """Result of checking a signature."""

    state: SignatureState = "not signed"
    """``does not match``: it does not match the content or is not by the expected key."""
    key: str | None = None
    """The public key of the signature; None if there is none."""
    is_expected: bool = False
    """Whether the key is the one the user expects. If False, anyone may have signed."""

    def __str__(self) -> str:
        if self.state != "signed":
            return "not signed" if self.state == "not signed" else "the signature does not match"
        return f"signed by {self.key}" + ("" if self.is_expected else "; use --public-key to check whose key that is")


class Signer:
    """A private key."""

    def __init__(self, key: Ed25519PrivateKey) -> None:
        self._key, self._public = key, key.public_key().public_bytes_raw().hex()

    def sign(self, said: bytes) -> Signature:
        """Sign any bytes. They must begin with a content type, so that a signature of one type cannot be reused for
        another."""
        return Signature(self._public, self._key.sign(said).hex())


def new_keys(private: Path) -> tuple[Path, str]:
    """Write a new private key, readable by its owner only, and ``NAME.pub`` beside it. Returns the path of the public
    key and its 64 hexadecimal digits. BadInput if one of the files exists or cannot be written."""
    ed25519, serialization = _cryptography()
    key, public = ed25519.Ed25519PrivateKey.generate(), private.with_name(f"{private.name}.pub")
    pem, raw = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    secret = key.private_bytes(pem, raw, serialization.NoEncryption())
    shown = key.public_key().public_bytes(pem, serialization.PublicFormat.SubjectPublicKeyInfo)
    ensure_new(private)
    ensure_new(public)
    for path, data, mode in ((private, secret, 0o600), (public, shown, 0o644)):
        try:
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
                file.write(data)
        except OSError as error:
            raise BadInput(f"{path}: cannot be written: {reason_of(error)}") from None
    return public, key.public_key().public_bytes_raw().hex()


def configured_signer() -> Signer | None:
    """Signer with the key in ``CIPV_SIGNING_KEY``; None if it is not set. BadInput if the file is not a private key or
    is readable by others, so that nothing is left unsigned by mistake."""
    named = os.environ.get(SIGNING_VARIABLE)
    if not named:
        return None
    ed25519, serialization = _cryptography()
    path = given_path(named)
    data = _read(path)
    if os.name == "posix" and path.stat().st_mode & _OTHERS:
        raise BadInput(f"{path}: others may read this private key; run `chmod 600` on it")
    try:
        key = serialization.load_pem_private_key(data, None)
    except (ValueError, TypeError):
        key = None
    if not isinstance(key, ed25519.Ed25519PrivateKey):
        raise BadInput(f"{path}: not a private key as `cipv keys new` writes it")
    return Signer(key)


def expected_key(path: Path | None = None) -> str | None:
    """The public key in a file, by default the file in ``CIPV_PUBLIC_KEY``; None if neither is given. BadInput if the
    file is not a public key."""
    named = path or os.environ.get(PUBLIC_VARIABLE)
    if not named:
        return None
    ed25519, serialization = _cryptography()
    file = given_path(named)
    try:
        key = serialization.load_pem_public_key(_read(file))
    except ValueError:
        key = None
    if not isinstance(key, ed25519.Ed25519PublicKey):
        raise BadInput(f"{file}: not a public key as `cipv keys new` writes it")
    return key.public_bytes_raw().hex()


def check_signature(signature: Signature | None, said: bytes, expected: str | None) -> SignatureCheck:
    """Whether a signature matches these bytes and, if given, the expected key. BadInput if the required package is
    missing."""
    if signature is None:
        return SignatureCheck()
    ed25519, _ = _cryptography()
    from cryptography.exceptions import InvalidSignature

    try:
        key = ed25519.Ed25519PublicKey.from_public_bytes(bytes.fromhex(signature.key))
        key.verify(bytes.fromhex(signature.value), said)
    except (InvalidSignature, ValueError):
        return SignatureCheck("does not match", signature.key)
    if expected is not None and expected != signature.key:
        return SignatureCheck("does not match", signature.key)
    return SignatureCheck("signed", signature.key, expected is not None)


def _read(path: Path) -> bytes:
    try:
        return read_regular(path, _LARGEST_KEY)
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {reason_of(error)}") from None


def _cryptography() -> tuple[ModuleType, ModuleType]:
    """The package's modules for Ed25519 and for key files. BadInput if it is not installed."""
    try:
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ImportError:
        raise BadInput("signatures need the package `cryptography`; install the extra `signing`") from None
    return ed25519, serialization
