"""A bounded cache that evicts the least recently used entries first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class BoundedCache(Generic[K, V]):
    """Holds entries up to a total cost (``cost(value)``, for instance bytes). Not thread-safe: one owner."""

    def __init__(self, limit: float, cost: Callable[[V], float]) -> None:
        self._limit = limit
        self._cost = cost
        self._total = 0.0
        self._entries: OrderedDict[K, V] = OrderedDict()

    def __len__(self) -> int:
        return len(self._entries)

    def get(self, key: K) -> V | None:
        """The entry, or None if it is not in the cache. Reading counts as use."""
        value = self._entries.get(key)
        if value is not None:
            self._entries.move_to_end(key)
        return value

    def put(self, key: K, value: V) -> None:
        """Store ``value``; an entry that exceeds the limit by itself is kept until the next one is stored."""
        old = self._entries.pop(key, None)
        if old is not None:
            self._total -= self._cost(old)
        self._entries[key] = value
        self._total += self._cost(value)
        while self._total > self._limit and len(self._entries) > 1:
            _, oldest = self._entries.popitem(last=False)
            self._total -= self._cost(oldest)
