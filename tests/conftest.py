"""Shared fixtures: the folder of real recordings, or a skip with a reason without it."""

from __future__ import annotations

import gc
import os
import signal
import tempfile
from collections.abc import Generator
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path

import httpx
import pytest
from hypothesis import settings
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling
from xdist.workermanage import WorkerController

from pipeline.common.files.data_dir import data_dir as recordings

# No deadline, so that a slow machine fails no example. In CI, the examples are the same in every run.
settings.register_profile("desk", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "desk")

# Servers started by tests keep labels here, never in the sessions folder of the developer.
_LABELS = tempfile.TemporaryDirectory(prefix="cipv-test-labels-", ignore_cleanup_errors=True)
os.environ["CIPV_LABELS_URL"] = f"sqlite:///{_LABELS.name}/labels.db"

# Tests talk to servers of their own on this machine, which a company's proxy does not know.
for _variable in [name for name in os.environ if name.lower() in ("http_proxy", "https_proxy", "all_proxy")]:
    del os.environ[_variable]

# A client reads the certificates of all authorities when it is made, which takes 25 ms. Those of tests share them; the
# few that talk TLS bring their own.
httpx._transports.default.create_ssl_context = cache(httpx.create_ssl_context)

ROOT = Path(__file__).resolve().parent.parent
_TOGETHER = ("accuracy",)
"""Folders whose files stay in one process: they use the same recordings and networks, and each image is processed once
(``tests.looking``)."""
_LONG = ("accuracy", "soak", "golden", "app/commands", "app/labels/test_kill.py", "pipeline/experiments")
_BROWSER = "browser"
_WAITING = (
    "browser/test_align.py",
    "browser/labels/test_tasks.py",
    "browser/labels/test_astyx.py",
    "browser/test_dashboard.py",
    "browser/test_rerun.py",
    _BROWSER,
)
"""The files that take longest, by what they do: compute, or wait for a browser."""

# Shells start background jobs with Ctrl-C ignored, but some tests send it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Every process imports all test files, in the same order. In a fresh clone, all would compile each file at the
    same moment; so each imports a share of its own first, and finds the others' compiled."""
    count = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if count == 1:
        return
    number = int(os.environ["PYTEST_XDIST_WORKER"].removeprefix("gw"))
    places = [Path(argument.partition("::")[0]).resolve() for argument in session.config.args]
    files = [file for place in places for file in ([place] if place.is_file() else sorted(place.rglob("test_*.py")))]
    for file in files[len(files) * number // count : len(files) * (number + 1) // count]:
        with suppress(Exception, pytest.skip.Exception):  # collecting the file says it again
            import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect no garbage while test files are imported, and none of what they brought later: the 670,000 objects of
    modules and tests live as long as the process, and looking at them takes 0.4 s, whatever a test left behind."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run long files first: at the end, one would keep a single process busy."""
    files = list(dict.fromkeys(item.path for item in items))
    long, waiting = (
        [file for place in places for file in files if _is_in(file, place)] for places in (_LONG, _WAITING)
    )
    # last: in a single process, nothing else can run after them
    others = [file for file in files if file not in waiting]
    order = {file: number for number, file in enumerate(dict.fromkeys([*long, *others, *waiting]))}
    items.sort(key=lambda item: order[item.path])


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling:
    """Each process takes the next file that it may run, or the next folder whose files stay together."""
    return _Together(config, log)


class _Together(LoadFileScheduling):
    """Half of the processes, rounded down, have browser files from the beginning, so that they wait while the others
    compute; those come to them last. A process that has had a browser file gets no other, since a browser keeps an
    event loop in its process."""

    def _split_scope(self, nodeid: str) -> str:
        file = super()._split_scope(nodeid)
        return next((place for place in _TOGETHER if _is_in(ROOT / file, place)), file)

    def _reschedule(self, node: WorkerController) -> None:
        if self.workqueue and self._next_for(node) is None:
            node.shutdown()  # what is left is for the others
        else:
            super()._reschedule(node)

    def _assign_work_unit(self, node: WorkerController) -> None:
        chosen = self._next_for(node)
        assert chosen is not None
        self.workqueue.move_to_end(chosen, last=False)
        super()._assign_work_unit(node)

    def _next_for(self, node: WorkerController) -> str | None:
        """The scope that a process runs next; None if it may run none of those left."""
        has_browser = any(map(_needs_browser, self.assigned_work[node]))
        begins_with_browser = node in self.nodes[: len(self.nodes) // 2]
        for wants_browser in (True,) if has_browser else (begins_with_browser, not begins_with_browser):
            if found := next((scope for scope in self.workqueue if _needs_browser(scope) == wants_browser), None):
                return found
        return None


def _needs_browser(scope: str) -> bool:
    return scope.startswith(f"tests/{_BROWSER}/")


def _is_in(file: Path, place: str) -> bool:
    return file.is_relative_to(ROOT / "tests" / place)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings and models (``CIPV_DATA``); skips the test if it does not exist."""
    folder = recordings()
    if not folder.is_dir():
        pytest.skip(f"real recordings not found at {folder} (set CIPV_DATA)")
    return folder
