"""Opens a source and shows a progress bar meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import PurePath
from typing import TYPE_CHECKING

from pipeline.common import progress
from pipeline.sources import open_any, open_source
from pipeline.types.source import AnySource, Source

if TYPE_CHECKING:
    from rich.progress import Progress

_LONGEST_NAME = 40


def opened(uri: str, rings: int = 16) -> AnySource:
    """Open a recording or live sensors, with a progress bar if a whole file has to be read first. Raises what
    ``open_any`` raises."""
    with _reading(uri) as told:
        return open_any(uri, rings=rings, progress=told)


def opened_recording(uri: str, rings: int = 16) -> Source:
    """The same for recordings only."""
    with _reading(uri) as told:
        return open_source(uri, rings=rings, progress=told)


@contextmanager
def _reading(uri: str) -> Iterator[progress.Progress]:
    """The progress callback. The bar appears with the first report, so that sources that open at once show none."""
    name = PurePath(uri.partition("?")[0]).name[-_LONGEST_NAME:]
    with ExitStack() as stack:
        bars: list[Progress] = []

        def told(done: int, total: int) -> None:
            if not bars:
                from app.commands.support.progress_bars import (
                    share_progress,  # rich takes 0.1 s to import, and most recordings need no bar
                )

                bars.append(stack.enter_context(share_progress()))
                bars[0].add_task(f"reading {name}", total=total)
            bars[0].update(bars[0].task_ids[0], completed=done, total=total)

        yield told
