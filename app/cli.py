"""The `cipv` command. Exit codes: 0 done, 1 the work failed, 2 bad usage or bad input (one line, no traceback)."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable

import tyro

from app.commands.bench import Bench
from app.commands.calibrate import Calibrate
from app.commands.models import Models
from app.commands.params import ListParams
from app.commands.run import Run
from app.commands.scenarios import Scenarios
from app.commands.serve import Demo, Serve
from pipeline.errors import BadInput

COMMANDS: dict[str, Callable[..., Callable[[], int]]] = {
    "demo": Demo,
    "serve": Serve,
    "run": Run,
    "models": Models,
    "params": ListParams,
    "calibrate": Calibrate,
    "scenarios": Scenarios,
    "bench": Bench,
}

_NAMED_WRONG = (FileNotFoundError, PermissionError, IsADirectoryError, NotADirectoryError)
"""A path that a person named cannot be used; any other failure of the system is not their doing."""


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the console script."""
    command = tyro.extras.subcommand_cli_from_dict(
        COMMANDS,
        args=arguments,
        prog="cipv",
        description="CIPV Studio: which vehicle ahead is the closest one in my path, how far, how fast, and why.",
        config=(tyro.conf.OmitArgPrefixes, tyro.conf.OmitSubcommandPrefixes),
    )
    try:
        raise SystemExit(command())
    except BadInput as error:
        print(f"cipv: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except BrokenPipeError:
        # the reader of our output has gone (`cipv run … | head`): nothing is wrong, and nothing more can be written
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(0) from None
    except OSError as error:
        print(f"cipv: {error.strerror or error}: {error.filename or ''}".rstrip(": "), file=sys.stderr)
        raise SystemExit(2 if isinstance(error, _NAMED_WRONG) else 1) from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    except Exception as error:
        if os.environ.get("CIPV_DEBUG"):
            raise
        print(f"cipv: {type(error).__name__}: {error} (CIPV_DEBUG=1 shows where)", file=sys.stderr)
        raise SystemExit(1) from None
