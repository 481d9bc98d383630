"""The uncertainty budget as a table: the contribution of each component to each angle."""

from __future__ import annotations

from ...measurement import Measurement, Stated, against, stated
from ..format.layout import aligned
from ..format.view import PAPER, View
from ..format.writer import Writer
from .plain import plain_writer

EXPLAINED = """\
Uncertainty budget: contribution of each component to the variance, percent. U: expanded uncertainty
(95 %). frame: the part of the variance that arrives through the four wheel centres of the frame."""


def budget_text(measurement: Measurement, view: View = PAPER) -> str:
    """Return the budget of each quantity against an axis, and the noise of each scan."""
    writer = plain_writer(view)
    components = measurement.uncertainty.components
    rows: list[tuple[str, ...]] = [("", "u", "U", *components, "frame")]
    for quantity in against(stated(measurement), view.axis):
        if quantity.kind != "camber_iso":
            rows.append(_row(quantity, writer))
    parts = [EXPLAINED, aligned(rows, left=1)]
    noise = _noise_rows(measurement, writer)
    if len(noise) > 1:
        parts += ["", NOISE, aligned(noise, left=1)]
    return "\n".join(parts)


NOISE = """\
Noise of each scan across its plane: sigma of a point, its correlated part and correlation length,
the number of points N and of effective independent points, and u of the tilt with and without
correlation."""


def _row(quantity: Stated, writer: Writer) -> tuple[str, ...]:
    u, expanded = writer.spread(quantity)
    contributions = (
        f"{100.0 * share:.1f}" for share in (*quantity.contributions, quantity.through_frame)
    )
    return (quantity.name.replace("_", " ").replace(".", " "), u, expanded, *contributions)


def _noise_rows(measurement: Measurement, writer: Writer) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = [
        ("", "sigma", "correlated", "over", "N", "N effective", "u tilt", "if independent")
    ]
    for result in measurement.wheels:
        plane = result.observation.evidence.plane if result.observation.evidence else None
        if plane is None:
            continue
        seen = plane.correlated
        rows.append(
            (
                result.observation.name,
                writer.millimetres(plane.sigma_m),
                writer.millimetres(seen.sigma_m) if seen.sigma_m > 0.0 else "none",
                f"{seen.length_m * 1e3:.0f} mm" if seen.sigma_m > 0.0 else "-",
                f"{plane.count}",
                f"{plane.effective_count:.0f}",
                writer.size(plane.tilt_rad, "rad"),
                writer.size(plane.tilt_if_independent_rad, "rad"),
            )
        )
    return rows
