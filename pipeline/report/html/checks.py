"""What a report says of checks: repeat scans, and random trials beside the formula."""

from __future__ import annotations

from ...measurement import Measurement, PooledAngle, pool_repeats
from ...uncertainty import TOLERANCE, MonteCarlo
from ..format.language import Translations
from ..format.writer import Table, Writer


def repeats_table(measurement: Measurement, writer: Writer) -> Table | None:
    """Pooled angles of repeat scans, their scatter against the prediction, and their drift."""
    words = writer.words
    rows = [
        [group.of, writer.quantity(angle.kind), str(len(group.scans)), *_pooled(angle, writer)]
        for group in pool_repeats(measurement)
        for angle in group.angles
    ]
    head = (words("results.name"), words("vehicle.quantity"), words("turned.scans"),
            words("checks.pooled"), "u", words("checks.scatter"), words("checks.chance"),
            words("checks.drift"), "u", words("status.status"))  # fmt: skip
    return Table(head, rows, 2, words("checks.repeats")) if rows else None


def _pooled(angle: PooledAngle, writer: Writer) -> list[str]:
    words = writer.words
    return [
        writer.plain(angle.pooled, "rad"), writer.size(angle.u, "rad"),
        words.number(f"{angle.chi_square / angle.dof:.2f}"), writer.share(angle.probability),
        writer.size(angle.drift, "rad"), writer.size(angle.u_drift, "rad"),
        words.known("checks", angle.status),
    ]  # fmt: skip


def monte_carlo_words(drawn: MonteCarlo, words: Translations) -> str:
    """What random trials say of the formula's uncertainties."""
    said = words.known("checks", drawn.status, tolerance=f"{TOLERANCE:.0%}".replace("%", " %"))
    return f"{words('checks.trials', trials=str(drawn.trials))} {said}"
