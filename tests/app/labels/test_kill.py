"""What was answered as saved survives ``kill -9`` of the server."""

from __future__ import annotations

from pathlib import Path

from tests.app.labels.kills import kill_again_and_again

KILLS = 5


def test_what_was_answered_as_saved_survives_the_server(file: Path) -> None:
    answered, lost = kill_again_and_again(file, KILLS, seed=7)
    assert answered >= KILLS, "it was killed before it could do anything: nothing is shown"
    assert lost == 0
