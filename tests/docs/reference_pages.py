"""Writes the parts of the documentation that are generated from the code: parameters, command line, layers.
``make docs`` runs it.

It is here instead of in the program because it reads the whole command line, which only the top layer may import.
"""

from __future__ import annotations

import argparse
import re
import tomllib
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import tyro

from app.cli import _CONFIG, COMMANDS, _command
from app.core.session_folder import SESSIONS
from pipeline.params import PRESETS, Params
from tests.docs.fleet_tables_page import tables_page

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
_MADE = "*This page is generated from the code by `make docs`; change the declarations, not the page.*"


def main() -> None:
    """Write all generated pages."""
    for name, make in PAGES.items():
        (DOCS / name).write_text(make(), encoding="utf-8")


# ---------------------------------------------------------------- layers


def with_layers(text: str) -> str:
    """The architecture page with the layers that import-linter holds, in its blocks named ``layers <package>``."""
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]:
        if contract["type"] == "layers":
            (package,) = contract["containers"]
            block = "\n".join((f"```layers {package}", *contract["layers"], "```"))
            text, count = re.subn(rf"```layers {package}\n.*?```", block, text, flags=re.DOTALL)
            assert count == 1, f"docs/architecture.md needs one block of the layers of {package}"
    return text


# ---------------------------------------------------------------- parameters


def parameters_page() -> str:
    """Every parameter, by stage."""
    return "\n".join(_parameter_lines()) + "\n"


def _parameter_lines() -> Iterator[str]:
    yield from (
        "# Parameters",
        "",
        _MADE,
        "",
        "Every parameter of the pipeline is declared once, in `pipeline/params/`. The sliders of the dashboard,",
        "`--set`, `--params` and the API all use that declaration. Values out of range and unknown names are rejected.",
        "",
        "    cipv run sim:straight --set cluster.z_weight=0.3 --set cipv.confirm_hits=2",
        "    cipv params --preset paper --yaml > mine.yaml",
        "    cipv run sim:straight --params mine.yaml",
        "",
        "`auto` (`null` in a YAML or JSON file) takes the value from the recording's calibration or from the detector.",
        "The column *paper* gives the value of `--preset paper` where it differs from the default.",
    )
    for section_name, field in Params.model_fields.items():
        section = field.default
        yield from ("", f"## {section_name}", "", _flat(type(section).__doc__), "")
        yield "| parameter | default | paper | range | unit | meaning |"
        yield "|---|---|---|---|---|---|"
        changed = PRESETS["paper"].get(section_name, {})
        for name, info in type(section).model_fields.items():
            paper = _value(changed[name]) if name in changed else ""
            extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
            cells = (
                f"`{section_name}.{name}`",
                _value(info.default),
                paper,
                _range(info),
                str(extra.get("unit", "")),
                _flat(info.description),
            )
            yield f"| {' | '.join(_cell(cell) for cell in cells)} |"


def _range(info: Any) -> str:
    """The permitted range of a parameter, as text."""
    if get_origin(info.annotation) is Literal:
        return ", ".join(f"`{choice}`" for choice in get_args(info.annotation))
    if info.annotation is bool:
        return "`true`, `false`"
    low = next((each.ge for each in info.metadata if hasattr(each, "ge")), None)
    high = next((each.le for each in info.metadata if hasattr(each, "le")), None)
    return "" if low is None or high is None else f"{low:g} – {high:g}"


def _value(value: object) -> str:
    if value is None:
        return "auto"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value}`" if isinstance(value, str) else f"{value:g}"


# ---------------------------------------------------------------- command line


def cli_page() -> str:
    """Every command with its options."""
    return "\n".join(_cli_lines()) + "\n"


def _cli_lines() -> Iterator[str]:
    yield from (
        "# Command line",
        "",
        _MADE,
        "",
        "`cipv COMMAND --help` prints the same. Begin the report of a problem with what `cipv --version` prints.",
        "`make install` puts the program at `.venv/bin/cipv`.",
        "",
        "The exit status is 0 for success, 1 for failure, and 2 for bad usage or bad input. An error is one line on",
        "standard error; set `CIPV_DEBUG=1` for the traceback of an unexpected one. Results go to standard output,",
        "everything else to standard error, so output can be piped.",
        "",
        "Files that can be opened again are never overwritten: sessions, labels, calibrations, presets, settings and",
        "keys. Results and reports, which the same command writes again, are replaced.",
        "",
        "## Environment",
        "",
        "| variable | meaning |",
        "|---|---|",
        "| `CIPV_DATA` | folder with this machine's data sets and networks (`models/`) |",
        "| `CIPV_HOME` | folder for downloaded and registered networks and caches, and for compiled kernels if the "
        "installation is read-only; default: `~/.cache/cipv`, or a private temporary folder if there is no home |",
        "| `CIPV_FOLDERS` | folders that the page and the API may open files from, separated by `:` |",
        "| `CIPV_SIGNING_KEY` | private key, of `cipv keys new`, that sessions and label versions are signed with |",
        "| `CIPV_PUBLIC_KEY` | public key that `cipv info` and label versions are checked with; versions that it "
        "did not sign are refused |",
        "| `CIPV_ADDRESSES` | stores, or folders in them, that may be opened too when `CIPV_FOLDERS` is set, "
        "separated by spaces |",
        "| `CIPV_LABELS_URL` | label database; `--labels` and `--database` override it |",
        "| `CIPV_TOKEN`, `CIPV_DISPLAY_TOKEN` | tokens for the links that other machines use, at least 16 characters |",
        "| `CIPV_DEBUG` | when set, an unexpected error shows its traceback |",
    )
    for title, about, name, prefixes in _SHARED:
        yield from ("", f"## {title}", "", about, "")
        yield from _table(
            [row for action in parser_of(name)._actions if (row := _option(action, prefixes)) is not None]
        )
    for name in commands():
        yield from ("", f"## cipv {name}", "", *_command_lines(name))


_SHARED = (
    ("Source options", "For every command that opens a recording.", "run", ("source.",)),
    (
        "Pipeline options",
        "For every command that runs the pipeline: parameters and networks.",
        "run",
        ("pipeline.", "line."),
    ),
    ("Server options", "For the commands that serve the dashboard.", "serve", ("server.",)),
)
"""Options that several commands share: title, description, a command that has them, prefixes of their names in the
parser."""


@cache
def commands() -> list[str]:
    """Every command by its words, including each subcommand of a group."""
    found: list[str] = []
    for name in COMMANDS:
        found += [f"{name} {word}" for word in _subcommands(name)] or [name]
    return list(dict.fromkeys(found))


@cache
def parser_of(name: str) -> argparse.ArgumentParser:
    """The parser of a command, or of a group's subcommand."""
    group, _, word = name.partition(" ")
    command = _subcommands(group)[word] if word and name not in COMMANDS else _command(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # tyro offers no other access to what its help shows
        return tyro.extras.get_parser(command, prog=f"cipv {name}", config=_CONFIG)


def _subcommands(name: str) -> dict[str, Any]:
    """The subcommands of a group: name → class. Empty for a command that is not a group."""
    kinds = get_args(get_type_hints(_command(name), include_extras=True).get("action", None))
    found = {}
    for kind in kinds:
        cls, *notes = get_args(kind)
        found |= {note.name: cls for note in notes if hasattr(note, "name")}
    return found


def _command_lines(name: str) -> Iterator[str]:
    parser = parser_of(name)
    about, _, example = (parser.description or "").partition("Example: ")
    yield _flat(about)
    if example:
        yield from ("", *(f"    {line}" for line in _flat(example).split(", and beside it: ")))
    own = [row for action in parser._actions if (row := _option(action)) is not None]
    if own:
        yield from ("", *_table(own))
    shared = [
        f"[{title.lower()}](#{title.lower().replace(' ', '-')})"
        for title, _, _, prefixes in _SHARED
        if any(action.dest.startswith(prefixes) and action.option_strings for action in parser._actions)
    ]
    if shared:
        yield from ("", f"Also takes the {' and the '.join(shared)}.")


def _table(rows: list[tuple[str, str, str]]) -> Iterator[str]:
    yield from ("| option | default | meaning |", "|---|---|---|")
    for row in sorted(rows, key=lambda row: row[0].startswith("`-")):  # positional arguments come first
        yield f"| {' | '.join(_cell(cell) for cell in row)} |"


def _option(action: argparse.Action, prefixes: tuple[str, ...] = ()) -> tuple[str, str, str] | None:
    """A row for an option with one of these prefixes; without prefixes, for the command's own options and its
    positional arguments."""
    shared = any(action.dest.startswith(each) for *_, each in _SHARED)
    if prefixes:
        wanted = action.dest.startswith(prefixes) and bool(action.option_strings)
    else:
        wanted = not shared or not action.option_strings
    if "--help" in action.option_strings or not wanted:
        return None
    meaning = _flat(action.help)
    if meaning.count("repeatable") > 1:
        meaning = meaning.removesuffix(" (repeatable)")
    text, _, tail = meaning.rpartition(" (")
    default = ""
    if tail.startswith("default: "):
        default, meaning = tail.removeprefix("default: ").rstrip(")"), text
    elif tail.startswith("required"):
        default, meaning = ("required", text) if action.option_strings else ("", text)
    if action.dest.endswith("person"):
        default = "your login name"
    default = default.replace(str(SESSIONS.parent) + "/", "")
    is_switch = isinstance(action, argparse.BooleanOptionalAction) or any(
        "--no-" in each for each in action.option_strings
    )
    if default in ("None", "[]") or (is_switch and default == "False"):
        default = ""
    if is_switch and default == "True":
        default = "on"
    plain = default in ("", "required", "your login name", "on")
    return _spelled(action, is_switch, default == "on"), default if plain else f"`{default}`", meaning


def _spelled(action: argparse.Action, is_switch: bool, is_on: bool) -> str:
    """The option as typed, with its metavar."""
    takes = str(action.metavar or "").replace("{None}|", "").replace("{", "").replace("}", "")
    if not action.option_strings:
        return f"`{takes if takes.isupper() else action.dest.rpartition('.')[2].upper()}`"
    if is_switch:  # the form that changes the default
        return f"`{next(each for each in action.option_strings if each.startswith('--no-') == is_on)}`"
    return f"`{action.option_strings[0]} {takes}`"


def _flat(text: str | None) -> str:
    return " ".join((text or "").split())


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


PAGES: dict[str, Callable[[], str]] = {
    "reference/parameters.md": parameters_page,
    "reference/cli.md": cli_page,
    "reference/fleet-tables.md": lambda: tables_page(_MADE),
    "architecture.md": lambda: with_layers((DOCS / "architecture.md").read_text(encoding="utf-8")),
}
"""File below ``docs/`` → what makes its text."""


if __name__ == "__main__":
    main()
