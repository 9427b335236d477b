"""Shared fixtures: where the real recordings are, and skipping with a reason when they are not."""

from __future__ import annotations

import os
import signal
import tempfile
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from pipeline.common.data_dir import data_dir as recordings

# A loaded machine must not fail an example for being slow; in CI the examples are the same in every run, at a desk new.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "desk")

# Servers that tests start keep labels here, and never in the sessions of who runs the tests.
_LABELS = tempfile.TemporaryDirectory(prefix="cipv-test-labels-", ignore_cleanup_errors=True)
os.environ["CIPV_LABELS_URL"] = f"sqlite:///{_LABELS.name}/labels.db"

ROOT = Path(__file__).resolve().parent.parent
_TOGETHER = ("accuracy",)
"""Folders whose files stay in one process of several: they look at the same recordings with the same networks, each
image once (``tests.looking``)."""
_LONG = ("accuracy", "soak", "golden", "app/commands", "app/labels/test_kill.py", "pipeline/experiments")
_WAITING = ("browser/test_dashboard.py", "browser/labels/test_astyx.py", "browser/test_rerun.py", "browser")
"""Where the files are that take longest, by what they do: compute, or wait for a browser."""

# Who runs the tests in the background may have told them to ignore Ctrl-C; some tests press it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first: one left to the end would keep a single process busy."""
    files = list(dict.fromkeys(item.path for item in items))
    long, waiting = (
        [file for place in places for file in files if _is_in(file, place)] for places in (_LONG, _WAITING)
    )
    # a browser keeps an event loop in its process, in which no other can run: its files come last
    others = [file for file in files if file not in waiting]
    order = {file: number for number, file in enumerate(dict.fromkeys([*long, *others, *waiting]))}
    items.sort(key=lambda item: order[item.path])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling:
    """Of several processes, each takes the next file, or the next folder of those that stay together."""
    return _Together(config, log)


class _Together(LoadFileScheduling):
    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return next((place for place in _TOGETHER if _is_in(ROOT / file, place)), file)


def _is_in(file: Path, place: str) -> bool:
    return file.is_relative_to(ROOT / "tests" / place)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings and models (``CIPV_DATA``); the test is skipped when it is not there."""
    folder = recordings()
    if not folder.is_dir():
        pytest.skip(f"real recordings not found at {folder} (set CIPV_DATA)")
    return folder
