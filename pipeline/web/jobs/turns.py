"""Turns of the processes that read scans: how many measure at once, and sort points beside them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Turns:
    """As many processes as there are workers, and one more that sorts points for the 3D view."""

    def __init__(self, workers: int) -> None:
        self.most = workers + 1
        self._measuring = threading.Semaphore(workers)
        self._sorting = threading.Semaphore(1)

    @contextmanager
    def taken(self) -> Iterator[Callable[[], None]]:
        """Hold a turn; calling what is yielded leaves it to the next, if no other one sorts."""
        self._measuring.acquire()
        held = self._measuring

        def leave() -> None:
            nonlocal held
            if held is self._measuring and self._sorting.acquire(blocking=False):
                held = self._sorting
                self._measuring.release()

        try:
            yield leave
        finally:
            held.release()
