"""The cache is bounded and evicts what was not used for longest."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from app.core.lru import BoundedCache


def test_forgets_the_least_recently_used():
    cache: BoundedCache[str, int] = BoundedCache(2, lambda _: 1)
    cache.put("a", 1)
    cache.put("b", 2)
    assert cache.get("a") == 1
    cache.put("c", 3)
    assert (cache.get("a"), cache.get("b"), cache.get("c")) == (1, None, 3)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(1, 30))))
def test_never_costs_more_than_its_limit_or_one_entry(puts: list[tuple[int, int]]):
    cache: BoundedCache[int, int] = BoundedCache(40, float)
    held: dict[int, int] = {}
    for key, value in puts:
        cache.put(key, value)
        held[key] = value
        present = {k: v for k in held if (v := cache.get(k)) is not None}
        assert present[key] == value
        assert sum(present.values()) <= 40 or len(present) == 1
        assert all(held[k] == v for k, v in present.items())


def test_what_is_replaced_costs_nothing_any_more():
    cache: BoundedCache[str, int] = BoundedCache(2, lambda _: 1)
    cache.put("kept", 0)
    for value in range(10):
        cache.put("again", value)
    assert (cache.get("kept"), cache.get("again"), len(cache)) == (0, 9, 2)
