"""Steering sweeps and run-outs as plain text."""

from __future__ import annotations

from ...measurement import Measurement
from ..format.view import PAPER, View
from ..tables.kinematics import Noted, runout_tables, steering_tables
from .plain import plain_writer


def steering_text(measurement: Measurement, view: View = PAPER) -> str:
    """Return the sweep's tables; empty without a sweep."""
    return _blocks(steering_tables(measurement, plain_writer(view)))


def runout_text(measurement: Measurement, view: View = PAPER) -> str:
    """Return the run-outs' tables; empty without any."""
    return _blocks(runout_tables(measurement, plain_writer(view)))


def _blocks(tables: Noted) -> str:
    return "\n".join(table.block(note) for table, note in tables)
