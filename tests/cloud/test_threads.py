"""Items one after another, then several at once: order, errors, and how many are held."""

from __future__ import annotations

import threading

import pytest

from wheelplane.cloud.threads import side_by_side

ITEMS = list(range(20))


class OddError(Exception):
    """An error that names its item."""


@pytest.fixture(params=["1", "2", "3"])
def threads(request, monkeypatch):
    monkeypatch.setenv("WHEELPLANE_THREADS", request.param)
    return int(request.param)


def fails_at(*bad):
    """A step that fails at some items."""

    def step(item):
        if item in bad:
            raise OddError(item)
        return item

    return step


def test_results_come_in_the_order_of_the_items(threads):
    turns = {k: threading.Event() for k in ITEMS}
    turns[ITEMS[0]].set()

    def later_first(item):
        if threads > 1 and item % 2 == 0:
            turns[item + 1].wait(10.0)
        turns[item].set()
        return -item

    assert side_by_side(lambda k: k, later_first, ITEMS) == [-k for k in ITEMS]


def test_the_first_step_runs_in_this_thread_in_order(threads):
    seen = []
    side_by_side(lambda k: seen.append((k, threading.current_thread())), lambda _: None, ITEMS)
    assert seen == [(k, threading.current_thread()) for k in ITEMS]


@pytest.mark.parametrize(
    ("first", "then", "raised"),
    [((), (3, 4), 3), ((5,), (4, 6), 4), ((4,), (5, 6), 4), ((0,), (1,), 0), ((19,), (18,), 18)],
)
def test_the_error_of_the_first_item_is_raised(threads, first, then, raised):
    with pytest.raises(OddError) as error:
        side_by_side(fails_at(*first), fails_at(*then), ITEMS)
    assert error.value.args == (raised,)


def test_at_most_one_item_waits_beside_those_at_work(threads):
    held, most = set(), []

    def take(item):
        held.add(item)
        most.append(len(held))
        return item

    side_by_side(take, held.discard, ITEMS)
    assert max(most) <= threads + 1
