"""Does slow work, such as reading, for the next items while the caller is still busy with the one before."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")
Done = TypeVar("Done")


def ahead(work: Callable[[Item], Done], items: Iterable[Item], threads: int = 1) -> Iterator[Done]:
    """``work(item)`` of each item, in order. As many calls as there are threads are ahead of the caller, and as many
    results are held at once. An exception of a call is raised in its turn."""
    with ThreadPoolExecutor(threads, "cipv-ahead") as pool:
        rest = iter(items)
        coming = deque(pool.submit(work, item) for item in islice(rest, threads))
        try:
            while coming:
                done = coming.popleft().result()
                coming.extend(pool.submit(work, item) for item in islice(rest, 1))
                yield done
        finally:
            for each in coming:
                each.cancel()
