"""`cipv keys`: make a key that sessions and label versions are signed with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from pipeline.common.files.signing import PUBLIC_VARIABLE, SIGNING_VARIABLE, expected_key, new_keys
from pipeline.common.files.user_file_errors import given_path


@dataclass(frozen=True)
class NewKeys:
    """Make a private key, and the public key that checks its signatures.

    Example: cipv keys new ~/cipv.key
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The private key to write; the public key is written beside it as FILE.pub. Neither is ever overwritten"""

    def __call__(self) -> int:
        private = given_path(self.file)
        public, digits = new_keys(private)
        print(f"private key: {private}\npublic key:  {public}, {digits}")
        print(f"To sign: {SIGNING_VARIABLE}={private}. To check: cipv info SESSION --public-key {public},")
        print(f"or {PUBLIC_VARIABLE}={public} for label versions too.")
        return 0


@dataclass(frozen=True)
class ShowKey:
    """Show the hexadecimal digits of a public key, as `cipv info` shows them for a signed session.

    Example: cipv keys show ~/cipv.key.pub
    """

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """The public key"""

    def __call__(self) -> int:
        print(expected_key(self.file))
        return 0


@dataclass(frozen=True)
class Keys:
    """Keys for signing sessions and label versions."""

    action: Annotated[NewKeys, tyro.conf.subcommand("new")] | Annotated[ShowKey, tyro.conf.subcommand("show")]

    def __call__(self) -> int:
        return self.action()
