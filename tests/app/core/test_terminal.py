"""Control sequences from recordings do not reach a terminal; our own do."""

from __future__ import annotations

import io
import re
import sys

import pytest
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from app.cli import main
from app.core.terminal import SafeTerminal, make_safe, one_line

HOSTILE = {
    "clipboard": "\x1b]52;c;cm0gLXJm\x07",
    "title": "\x1b]0;owned\x07",
    "clear": "\x1b[2J",
    "one character": "\x9b2J",
    "device control": "\x1bP$qm\x1b\\",
    "back": "a\x08b\x7f",
    "link that hides another sequence": "\x1b]8;;\x1b]52;c;eA==\x07\x1b\\",
}


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_what_a_recording_says_is_written_as_escapes(text: str):
    screen = Terminal()
    print(text, file=SafeTerminal(screen))
    said = screen.getvalue()
    assert not {each for each in said if not each.isprintable()} - {"\n"}
    assert "\\x" in said


def test_what_rich_draws_arrives_unchanged():
    plain, safe = Terminal(), Terminal()
    for screen in (plain, SafeTerminal(safe)):
        console = Console(file=screen, force_terminal=True, width=60, _environ={"TERM": "xterm"})
        table = Table("a", "b")
        table.add_row("[link=http://127.0.0.1/#x]here[/link]", "[bold red]there[/]\tü")
        console.print(table)
        with Progress(console=console, auto_refresh=False) as bar:
            task = bar.add_task("x", total=2)
            for _ in range(2):
                bar.update(task, advance=1)
                bar.refresh()
    numbered = re.compile(r"id=\d+")  # each link gets a number by chance
    assert numbered.sub("", safe.getvalue()) == numbered.sub("", plain.getvalue())
    assert "\x1b]8;" in safe.getvalue()


def test_commands_write_to_a_safe_terminal_and_errors_are_one_line(monkeypatch: pytest.MonkeyPatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    with pytest.raises(SystemExit) as end:
        main(["info", "no\x1b]0;owned\x07such\nfile.mcap"])
    assert end.value.code == 2
    assert isinstance(sys.stderr, SafeTerminal)
    assert screen.getvalue().count("\n") == 1
    assert r"no\x1b]0;owned\x07such\nfile.mcap" in screen.getvalue()


def test_pipes_get_what_is_written(monkeypatch: pytest.MonkeyPatch):
    pipe = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="strict")
    monkeypatch.setattr(sys, "stdout", pipe)
    make_safe()
    print("\x1b[2J", "bad\udcff", end="")
    pipe.flush()
    assert pipe.buffer.getvalue() == b"\x1b[2J bad\\udcff"  # type: ignore[attr-defined]


def test_one_line_keeps_letters():
    assert one_line("zwölf – 12\u202f km") == "zwölf – 12\u202f km"
