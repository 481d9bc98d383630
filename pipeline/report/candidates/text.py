"""An explanation as text for the terminal."""

from __future__ import annotations

from ...explanation import ExplainedScan, Explanation
from ..format.digits import rounded
from ..format.language import load_translations
from ..format.layout import aligned
from .tree import hint_of, verdict_of


def explanation_text(found: Explanation) -> str:
    """Return each scan, what became of it, and its candidates."""
    return "\n".join(_scan(scan, found.length_unit) for scan in found.scans)


def _scan(scan: ExplainedScan, unit: str) -> str:
    became = "measured" if scan.is_measured else f"{scan.status}: {scan.reason}"
    head = f"{scan.name} ({scan.file}): {became}"
    if not scan.candidates:
        return head
    words = load_translations("en")
    heading = ("", "verdict", "centre / m", "match", "noise / mm", "points")
    several = any(one.target for one in scan.candidates)
    rows: list[tuple[str, ...]] = [(*heading, "target") if several else heading]
    for one in scan.candidates:
        centre = ", ".join(rounded(x, -3, "") for x in one.candidate.centre_m)
        noise = f"{one.candidate.sigma_m * 1e3:.2f}"
        match, points = f"{one.candidate.match:.2f}", str(one.candidate.points)
        row = (str(one.number), verdict_of(one, words), f"({centre})", match, noise, points)
        rows.append((*row, one.target) if several else row)
    lines = [head, aligned(rows, left=2)]
    other = next((one for one in scan.candidates if one.standing != "chosen"), None)
    if not scan.is_measured and other and (hint := hint_of(scan, other, unit)):
        which = "first" if other.number == 1 else "second"
        lines.append(f"  to choose the {which}: --hint {hint}, or [hints] in capture.toml")
    return "\n".join(lines)
