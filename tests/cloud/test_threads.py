"""Items one after another and several at once: order, errors, how many are held, their ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
import weakref

import numpy as np
import pytest

from wheelplane.cloud import threads
from wheelplane.cloud.forked import Forked, can_fork, in_processes
from wheelplane.cloud.threads import over_chunks, over_items, side_by_side
from wheelplane.errors import InputError
from wheelplane.system import memory_limit, stage, taken, unlimited_bytes

ITEMS = list(range(20))
FORKS = pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")


class OddError(Exception):
    """An error that names its item."""


@pytest.fixture(params=["1", "2", "3", *(pytest.param(f"{n} forks", marks=FORKS) for n in (2, 3))])
def workers(request, monkeypatch):
    """Number of threads, or of forked processes."""
    count, _, forks = request.param.partition(" ")
    monkeypatch.setenv("WHEELPLANE_THREADS", count)
    monkeypatch.setattr("wheelplane.cloud.forked.can_fork", lambda: bool(forks))
    return int(count)


def ignore(_item):
    """A step that does nothing."""


def fails_at(*bad):
    """A step that fails at some items."""

    def step(item):
        if item in bad:
            raise OddError(item)
        return item

    return step


def test_results_come_in_the_order_of_the_items(workers, tmp_path):
    def later_first(item):
        end_s = time.monotonic() + 10.0
        while workers > 1 and item % 2 == 0 and time.monotonic() < end_s:
            if (tmp_path / str(item + 1)).exists():
                break
            time.sleep(0.001)
        (tmp_path / str(item)).touch()
        return -item

    assert over_items(later_first, ITEMS, ignore) == [-k for k in ITEMS]
    assert side_by_side(lambda k: k, later_first, ITEMS) == [-k for k in ITEMS]


def test_items_start_here_in_order(workers):
    seen, here = [], (threading.current_thread(), os.getpid())

    def begins(item):
        seen.append((item, threading.current_thread(), os.getpid()))

    over_items(ignore, ITEMS, begins)
    side_by_side(begins, ignore, ITEMS)
    assert seen == [(k, *here) for k in ITEMS] * 2


def test_one_at_a_time_starts_after_the_last_has_ended(workers):
    seen = []
    over_items(lambda k: seen.append(-k), ITEMS, seen.append, several=False)
    assert seen == [sign * k for k in ITEMS for sign in (1, -1)]


@FORKS
def test_processes_begin_no_more_items_than_they_work_on(monkeypatch):
    started, most = [], []
    answered = Forked.result

    def result(process):
        most.append(len(started) - len(most))
        return answered(process)

    monkeypatch.setattr(Forked, "result", result)
    in_processes(ignore, ITEMS, 3, {}, started.append)
    assert started == ITEMS
    assert max(most) == 3


@pytest.mark.parametrize(
    ("first", "then", "raised"),
    [((), (3, 4), 3), ((5,), (4, 6), 4), ((4,), (5, 6), 4), ((0,), (1,), 0), ((19,), (18,), 18)],
)
def test_the_error_of_the_first_item_is_raised(workers, first, then, raised):
    with pytest.raises(OddError) as error:
        side_by_side(fails_at(*first), fails_at(*then), ITEMS)
    assert error.value.args == (raised,)
    with pytest.raises(OddError) as error:
        over_items(fails_at(*first, *then), ITEMS, ignore)
    assert error.value.args == (min(first + then),)


@FORKS
def test_after_an_error_no_item_starts():
    started = []
    with pytest.raises(OddError):
        in_processes(fails_at(3), ITEMS, 1, {}, started.append)
    assert started == [0, 1, 2, 3]


def test_at_most_one_item_waits_beside_those_at_work(workers):
    made, most = [], []

    def take(_):
        points = np.zeros(3)
        made.append(weakref.ref(points))
        most.append(sum(one() is not None for one in made))
        return [points]

    side_by_side(take, lambda points: len(points.pop()), ITEMS)
    assert max(most) <= workers + 1


@FORKS
def test_a_process_that_is_killed_is_one_line_and_no_process_is_left(monkeypatch):
    monkeypatch.setenv("WHEELPLANE_THREADS", "3")
    monkeypatch.setattr("wheelplane.cloud.forked.can_fork", lambda: True)
    started, fork = [], os.fork
    monkeypatch.setattr(os, "fork", lambda: started.append(fork()) or started[-1])

    def ends(item):
        if item == 4:
            os.kill(os.getpid(), signal.SIGKILL)

    with pytest.raises(InputError, match="one of several processes was killed"):
        over_items(ends, ITEMS, ignore)
    assert started
    for process in started:
        with pytest.raises(ChildProcessError):
            os.waitpid(process, os.WNOHANG)


@FORKS
def test_forked_calls_add_their_stages():
    @stage("plane")
    def within(_):
        time.sleep(0.01)
        return np.zeros(10)

    taken()
    assert np.array_equal(in_processes(within, [None], 1, {}, ignore)[0], np.zeros(10))
    assert taken()["plane"] >= 0.01


@FORKS
def test_forked_calls_share_the_memory():
    with memory_limit(1 << 30):
        left = [in_processes(lambda _: unlimited_bytes(), [n], n, {}, ignore) for n in (1, 4)]
    assert left[1][0] == pytest.approx(left[0][0] / 4, rel=0.05)


IDLE = """
import os, threading
from wheelplane.cloud.threads import over_chunks, over_items
threads = set(over_chunks(lambda _: threading.current_thread(), 2, 1))
assert len(threads) == 2
found = over_items(lambda _: os.getpid(), range(20), lambda _: None)
assert os.getpid() not in found
assert len(set(over_chunks(lambda _: threading.current_thread(), 2, 1)) - threads) == 1
"""


@FORKS
def test_idle_threads_of_the_pool_do_not_hinder_forks():
    """In a process of its own, which has no threads of tests."""
    two = os.environ | {"WHEELPLANE_THREADS": "2"}
    subprocess.run([sys.executable, "-c", IDLE], env=two, check=True)


def test_beside_another_thread_nothing_is_forked(monkeypatch):
    monkeypatch.setenv("WHEELPLANE_THREADS", "2")
    stop = threading.Event()
    other = threading.Thread(target=stop.wait)
    other.start()
    try:
        assert not can_fork()
        over_chunks(lambda _: None, 2, 1)
        pool = threads._pool()
        assert over_items(lambda _: os.getpid(), ITEMS, ignore) == [os.getpid()] * len(ITEMS)
        assert threads._pool() is pool  # which the other thread may be using
    finally:
        stop.set()
        other.join()
