"""The certificate and the private key that the server uses for HTTPS."""

from __future__ import annotations

import ssl
from dataclasses import dataclass
from pathlib import Path

from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import LARGEST_TEXT_BYTES, read_regular


@dataclass(frozen=True)
class TlsFiles:
    """Files for HTTPS, PEM."""

    certificate: Path
    """Including its chain up to the root, if any."""
    key: Path
    """Key of the certificate, without a passphrase."""

    def context(self) -> ssl.SSLContext:
        """For a server. BadInput, which names the file and what is wrong with it, if they cannot be used."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        try:
            context.load_cert_chain(self.certificate, self.key, password=_no_password)
        except (OSError, ValueError) as error:  # SSLError is a subclass of OSError
            raise BadInput(_what_is_wrong(self.certificate, self.key) or f"{self._both}: {_reason(error)}") from None
        return context

    @property
    def _both(self) -> str:
        return f"{self.certificate}, {self.key}: cannot be used for TLS"


def _no_password() -> str:
    raise ValueError("the key needs a password")


def _what_is_wrong(certificate: Path, key: Path) -> str | None:
    """OpenSSL's errors name neither the file nor the cause; None if the files seem to be in order."""
    # takes 0.1 s to import, so it is imported only for files that cannot be used
    from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat, load_pem_private_key
    from cryptography.x509 import load_pem_x509_certificates

    texts = []
    for path in (certificate, key):
        try:
            texts.append(read_regular(path, LARGEST_TEXT_BYTES))
        except OSError as error:
            return f"{path}: {_reason(error)}"
    try:
        own = load_pem_x509_certificates(texts[0])[0]
    except ValueError:
        held = " but a private key; are --tls-cert and --tls-key swapped?" if b"PRIVATE KEY-----" in texts[0] else ""
        return f"{certificate}: holds no certificate in PEM format{held}"
    try:
        private = load_pem_private_key(texts[1], None)
    except TypeError:
        return f"{key}: the key needs a password; `openssl pkey -in {key} -out new.pem` writes it without one"
    except ValueError:
        return f"{key}: holds no private key in PEM format"
    of_certificate, of_key = (
        each.public_key().public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo) for each in (own, private)
    )
    return f"{key}: is not the key of the certificate in {certificate}" if of_certificate != of_key else None


def _reason(error: Exception) -> str:
    return getattr(error, "reason", None) or getattr(error, "strerror", None) or str(error)
