"""The origin of a session, as stored in its file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from pydantic import TypeAdapter, ValidationError

VERSION = 1
"""Of the sessions that are written; those of a later one cannot be read."""


@dataclass(frozen=True)
class About:
    """Where a session came from."""

    origin: str
    """The URI that was recorded."""
    title: str
    """Short, for a heading."""
    rate_hz: float
    """Nominal frames per second."""
    notes: tuple[str, ...] = ()
    """What a person should know about the whole recording."""
    networks: dict[str, str] = field(default_factory=dict)
    """SHA-256 of the file of each network that looked at the images, by its name."""
    version: int = VERSION
    """Of the session's form."""

    @property
    def is_of_simulator(self) -> bool:
        """Whether it was recorded from a drive through the simulator."""
        return self.origin.startswith("sim:")

    def to_metadata(self) -> dict[str, str]:
        """As MCAP keeps it: text to text."""
        return {key: json.dumps(value, ensure_ascii=False) for key, value in asdict(self).items()}

    @staticmethod
    def from_metadata(metadata: dict[str, str]) -> About:
        """ValueError when it is no such metadata."""
        try:
            return _ABOUT.validate_python({key: json.loads(value) for key, value in metadata.items()})
        except (ValidationError, RecursionError) as error:
            raise ValueError(str(error).splitlines()[0]) from None


_ABOUT = TypeAdapter(About)
