"""Stages of a measurement and their seconds."""

from __future__ import annotations

import threading
from contextlib import suppress

from wheelplane.system import stopwatch
from wheelplane.system.stopwatch import stage, taken


def test_a_stage_has_its_own_time_and_not_that_of_one_inside(monkeypatch):
    now_s = 0.0

    def spend(seconds: float) -> None:
        nonlocal now_s
        now_s += seconds

    def fails() -> None:
        spend(100.0)
        raise ValueError("bad")

    monkeypatch.setattr(stopwatch.time, "perf_counter", lambda: now_s)
    taken()
    with stage("segment"):
        spend(1.0)
        with stage("read"):
            spend(10.0)
            with suppress(ValueError):
                stage("plane")(fails)()
        stage("read")(lambda: spend(20.0))()
        spend(2.0)
    in_thread = threading.Thread(target=stage("angles")(lambda: spend(7.0)))
    in_thread.start()
    in_thread.join()
    assert taken() == {"read": 30.0, "segment": 3.0, "plane": 100.0, "angles": 7.0}
    assert taken() == {}
