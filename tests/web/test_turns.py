"""Turns: the next measurement begins while points are sorted, and no more than one sorts beside."""

from __future__ import annotations

import threading

from wheelplane.web.jobs.turns import Turns


class Process:
    """A thread that holds a turn until it is let go."""

    def __init__(self, turns):
        self.begun, self.go, self.left = threading.Event(), threading.Event(), threading.Event()
        self.leaves = threading.Event()
        self.thread = threading.Thread(target=self._run, args=[turns], daemon=True)
        self.thread.start()

    def _run(self, turns):
        with turns.taken() as leave:
            self.begun.set()
            self.leaves.wait(60)
            leave()
            leave()  # as often as its results are announced
            self.left.set()
            self.go.wait(60)

    def sort(self):
        self.leaves.set()
        assert self.left.wait(60)

    def end(self):
        self.leaves.set()
        self.go.set()
        self.thread.join(60)
        assert not self.thread.is_alive()


def test_a_measurement_begins_while_another_sorts_but_not_beside_a_measurement():
    turns = Turns(1)
    first = Process(turns)
    assert first.begun.wait(60)
    second = Process(turns)
    assert not second.begun.wait(0.2)
    first.sort()
    assert second.begun.wait(60)
    third = Process(turns)
    second.sort()  # another one sorts: it keeps its turn
    assert not third.begun.wait(0.2)
    first.end()
    assert not third.begun.wait(0.2)
    second.end()
    assert third.begun.wait(60)
    third.end()


def test_a_turn_is_free_again_after_an_error():
    turns = Turns(1)
    for _ in range(3):
        try:
            with turns.taken() as leave:
                leave()
                raise OSError
        except OSError:
            pass
    last = Process(turns)
    assert last.begun.wait(60)
    last.end()
