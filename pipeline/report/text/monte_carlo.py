"""The Monte Carlo check as a table: both uncertainties, and how far their intervals lie apart."""

from __future__ import annotations

import math

from ...measurement import Measurement, stated
from ...uncertainty import TOLERANCE, MonteCarlo
from ...vehicle import Axis
from ..format.layout import aligned

EXPLAINED = f"""\
Monte Carlo check (JCGM 101, clause 8): u by formula and by random trials; the ends of the two 95 %
intervals may lie {TOLERANCE:.0%} of u apart."""
VERDICTS = {
    "agree": "They agree.",
    "disagree": "They DISAGREE: trust the trials, and look at what is far from linear.",
    "not-converged": "The trials did not settle the ends: allow more of them.",
}


def monte_carlo_text(measurement: Measurement, drawn: MonteCarlo, axis: Axis = "rear-axle") -> str:
    """A line for each angle and length against one axis, then the verdict, on those of all axes."""
    rows: list[tuple[str, ...]] = [("", "u formula", "u trials", "apart / u")]
    for i, quantity in enumerate(stated(measurement)):
        if quantity.axis not in (None, axis):
            continue
        unit = quantity.unit
        u = float(drawn.formula[i])
        apart = f"{100.0 * float(drawn.apart[i]) / u:.2f} %" if u > 0.0 else "-"
        trials = float(drawn.standard[i])
        label = quantity.name.replace("_", " ").replace(".", " ")
        rows.append((label, _size(u, unit), _size(trials, unit), apart))
    verdict = f"{drawn.trials} trials. {VERDICTS[drawn.status]}"
    return f"{EXPLAINED}\n{aligned(rows, left=1)}\n  {verdict}"


def _size(value: float, unit: str) -> str:
    return f"{value * 1e3:.4f} mm" if unit == "m" else f'{math.degrees(value) * 3600:.2f}"'
