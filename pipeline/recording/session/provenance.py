"""The origin of a session, as stored in its file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field

from pydantic import TypeAdapter, ValidationError

VERSION = 1
"""Version of written sessions; later versions cannot be read."""


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
    """What a user should know about the whole recording."""
    networks: dict[str, str] = field(default_factory=dict)
    """SHA-256 of the file of each network used for the images, by its name."""
    version: int = VERSION
    """Version of the session format."""

    @property
    def is_of_simulator(self) -> bool:
        """Whether it was recorded from a simulated drive."""
        return self.origin.startswith("sim:")

    def to_metadata(self) -> dict[str, str]:
        """In MCAP's format: text to text."""
        return {key: json.dumps(value, ensure_ascii=False) for key, value in asdict(self).items()}

    @staticmethod
    def from_metadata(metadata: dict[str, str]) -> About:
        """ValueError if it is invalid."""
        try:
            return _ABOUT.validate_python({key: json.loads(value) for key, value in metadata.items()})
        except (ValidationError, RecursionError) as error:
            raise ValueError(str(error).splitlines()[0]) from None


_ABOUT = TypeAdapter(About)
