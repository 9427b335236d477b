"""Work for the next items is done while the caller is busy, in order, and no further ahead than asked."""

from __future__ import annotations

import threading

import pytest

from pipeline.common.ahead import ahead

WAIT_S = 60.0


@pytest.mark.parametrize("threads", [1, 3, 20])
def test_results_come_in_the_order_of_the_items(threads: int) -> None:
    assert list(ahead(lambda item: item * item, range(10), threads)) == [item * item for item in range(10)]


def test_the_next_item_is_worked_on_while_the_caller_has_the_one_before() -> None:
    begun = [threading.Event() for _ in range(3)]

    def work(item: int) -> int:
        begun[item].set()
        return item

    results = ahead(work, range(3))
    assert next(results) == 0
    assert begun[1].wait(WAIT_S), "without being asked for it"
    assert list(results) == [1, 2]


def test_it_is_not_further_ahead_than_it_has_threads() -> None:
    taken: list[int] = []

    def items():
        for item in range(100):
            taken.append(item)
            yield item

    results = ahead(lambda item: item, items(), threads=2)
    assert next(results) == 0
    assert taken == [0, 1, 2]
    results.close()
    assert taken == [0, 1, 2]


def test_an_error_is_raised_in_its_turn() -> None:
    results = ahead(lambda item: 1 // item, [2, 1, 0, 5])
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)
