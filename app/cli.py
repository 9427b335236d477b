"""The `cipv` command. Exit codes: 0 done, 1 the work failed, 2 bad usage or bad input (one line, no traceback)."""

from __future__ import annotations

import ast
import os
import platform
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from app.core.stop_signals import as_interrupts
from app.core.terminal import make_safe, one_line
from pipeline.common.errors import BadInput
from pipeline.common.files.user_files import Overloaded
from pipeline.common.garbage_collection import collect_less_often

COMMANDS = {
    "demo": "app.commands.serve:Demo",
    "serve": "app.commands.serve:Serve",
    "run": "app.commands.run:RunPipeline",
    "record": "app.commands.record:Record",
    "import": "app.commands.sessions:ImportRecording",
    "export": "app.commands.sessions:Export",
    "info": "app.commands.info:ShowInfo",
    "recover": "app.commands.sessions:Recover",
    "keys": "app.commands.keys:Keys",
    "accounts": "app.commands.accounts:ListAccounts",
    "live": "app.commands.live:Live",
    "replay": "app.commands.replay:Replay",
    "labels": "app.commands.labels.labels:Labels",
    "labels export": "app.commands.labels.files:ExportLabels",
    "labels import": "app.commands.labels.files:ImportLabels",
    "models": "app.commands.models:Models",
    "params": "app.commands.params:ListParams",
    "calibrate": "app.commands.calibrate:Calibrate",
    "calibration": "app.commands.calibration:ConvertCalibration",
    "scenarios": "app.commands.scenarios:Scenarios",
    "evaluate": "app.commands.evaluate:Evaluate",
    "sync": "app.commands.fleet.sync:SyncSessions",
    "batch": "app.commands.fleet.batch:Batch",
    "sweep": "app.commands.fleet.sweep:ParameterSweep",
    "find": "app.commands.fleet.find:Find",
    "mine": "app.commands.fleet.mine:Mine",
    "compare": "app.commands.fleet.compare:Compare",
    "scores": "app.commands.fleet.scores:Scores",
    "bench": "app.commands.bench:Bench",
}
"""Command name → module and class. Only the chosen module is imported, since importing all takes seconds, and the
commands of a group have different dependencies."""

_CONFIG = (tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes)
_NAMED_WRONG = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError)
"""A path given by the user cannot be used; other system errors are not caused by the user."""
_PATHS = ConstructorRegistry()
"""Resolves ``~`` in arguments of type Path, which shells leave alone after ``--out=``."""


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the console script."""
    collect_less_often()
    typed = sys.argv[1:] if arguments is None else arguments
    make_safe()
    try:
        with as_interrupts():
            raise SystemExit(_parse(typed)())
    except BadInput as error:
        print(f"cipv: {one_line(error)}", file=sys.stderr)
        raise SystemExit(2) from None
    except Overloaded as error:
        print(f"cipv: {one_line(error)}", file=sys.stderr)
        raise SystemExit(1) from None
    except BrokenPipeError:
        # the reader of our output has exited (`cipv run … | head`): not an error, but nothing more can be written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0) from None
    except OSError as error:
        said = f"{error.strerror or error}: {error.filename or ''}"
        print(f"cipv: {one_line(said)}".rstrip(": "), file=sys.stderr)
        raise SystemExit(2 if isinstance(error, _NAMED_WRONG) else 1) from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    except Exception as error:
        if os.environ.get("CIPV_DEBUG"):
            raise
        print(f"cipv: {type(error).__name__}: {one_line(error)} (CIPV_DEBUG=1 shows where)", file=sys.stderr)
        raise SystemExit(1) from None


def _parse(arguments: list[str]) -> Callable[[], int]:
    """The command that was typed, with its options. SystemExit after help, and with 2 for wrong usage."""
    for words in (2, 1):
        name = " ".join(arguments[:words])
        if name in COMMANDS:
            with _PATHS:
                return tyro.cli(_command(name), args=arguments[words:], prog=f"cipv {name}", config=_CONFIG)
    if arguments[:1] == ["--version"]:
        return _show_version
    return tyro.extras.subcommand_cli_from_dict(
        {name: _stand_in(name) for name in COMMANDS if " " not in name},
        args=arguments,
        prog="cipv",
        description="CIPV Studio: which vehicle ahead is the closest one in my path, how far, how fast, and why. "
        "cipv --version prints the version.",
        config=_CONFIG,
    )


def _show_version() -> int:
    """What a report of a problem should begin with."""
    try:
        number = version("cipv-studio")
    except PackageNotFoundError:
        number = "not installed"
    print(f"CIPV Studio {number}, Python {platform.python_version()}, {platform.platform(terse=True)}")
    return 0


@_PATHS.primitive_rule
def _path(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Path] | None:
    if info.type is not Path:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=lambda typed: _given(typed[0]),
        is_instance=lambda value: isinstance(value, Path),
        str_from_instance=lambda path: [str(path)],
    )


def _given(text: str) -> Path:
    from pipeline.common.files.user_file_errors import given_path  # pydantic, which the list of commands does not need

    return given_path(text)


def _command(name: str) -> Any:
    module, _, attribute = COMMANDS[name].partition(":")
    return getattr(import_module(module), attribute)


def _stand_in(name: str) -> Callable[[], Callable[[], int]]:
    """Placeholder in the list of commands: its help is parsed from its source, since importing all commands takes
    seconds."""

    def command() -> Callable[[], int]:
        return _parse([name])

    module, _, attribute = COMMANDS[name].partition(":")
    found = find_spec(module)
    assert found is not None
    assert found.origin is not None
    source = ast.parse(Path(found.origin).read_text(encoding="utf-8"))
    shown = next(node for node in source.body if isinstance(node, ast.ClassDef) and node.name == attribute)
    command.__doc__ = ast.get_docstring(shown)
    return command


if __name__ == "__main__":
    main()
