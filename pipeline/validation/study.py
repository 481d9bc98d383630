"""Many captures in one folder: each compared, or a row that says why not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ..capture import clouds_of, is_capture, open_capture
from ..config import Config, with_scanner
from ..errors import InputError, WheelplaneError
from ..files import ARCHIVE_SUFFIXES
from ..uncertainty import as_many
from .agreement import Agreement, agreement, bias_probability
from .comparison import KINDS, Comparison, Verdict
from .request import Request
from .statistics.power import CONFIDENCE
from .validate_capture import validate_capture

EACH = 1.0 - math.sqrt(CONFIDENCE)  # of two tests, so that both hold in 95 % (Sidak)


@dataclass(frozen=True)
class Row:
    """One capture: compared, or why not."""

    name: str
    found: Comparison | None
    reason: str = ""


@dataclass(frozen=True)
class ComparisonStudy:
    """All captures of an archive, in the order of their names."""

    source: str
    rows: tuple[Row, ...]
    see_rad: float | None

    @property
    def found(self) -> tuple[Comparison, ...]:
        """Those that were compared."""
        return tuple(row.found for row in self.rows if row.found is not None)

    @property
    def complete(self) -> bool:
        """Whether every wheel of every capture was compared."""
        return all(row.found is not None and not row.found.missing for row in self.rows)

    @cached_property
    def agreements(self) -> tuple[Agreement, ...]:
        """Of toes and cambers; none for fewer than two captures."""
        each = (agreement(self.found, kind) for kind in KINDS)
        return tuple(one for one in each if one is not None)

    @cached_property
    def bias_probability(self) -> float | None:
        """Of mean differences as large as these; None for fewer than four captures."""
        return bias_probability(self.found)

    @property
    def disagreeing(self) -> int:
        """Captures whose own joint test fails."""
        return sum(not one.joint.agrees for one in self.found)

    @property
    def chance_of_disagreeing(self) -> float:
        """Of as many or more, where both methods and their uncertainties are right."""
        return as_many(self.disagreeing, len(self.found), 1.0 - CONFIDENCE)

    @property
    def visible_rad(self) -> float:
        """Smallest bias of toe, or of camber, whichever is larger, that these captures show."""
        return max((one.visible for one in self.agreements), default=math.inf)

    @property
    def verdict(self) -> Verdict:
        """No bias, and no more captures that disagree than chance allows."""
        bias = self.bias_probability
        if self.chance_of_disagreeing < EACH or (bias is not None and bias < EACH):
            return "disagree"
        blind = self.see_rad is not None and self.visible_rad > self.see_rad
        return "cannot tell" if bias is None or blind else "agree"


def is_archive_of_captures(source: Path) -> bool:
    """Whether it is a folder of captures, and no capture itself.

    A folder with one cloud is a capture, unless folders or archives lie beside: raises InputError.
    """
    if not source.is_dir() or is_capture(source):
        return False
    clouds = clouds_of(source)
    beside = [path.name for path in source.iterdir() if _may_be_capture(path)]
    if len(clouds) == 1 and beside == clouds:
        return False
    if len(clouds) == 1:
        raise InputError(
            f"{source}: holds the cloud {clouds[0]} and {len(beside) - 1} folders or archives, so "
            "it may be one capture or a folder of many: name the cloud itself, or move it"
        )
    return True


def validate_archive(
    source: Path,
    target: str | None,
    config: Config,
    scanner: str | None,
    request: Request,
    progress: Callable[[str], None] = lambda _: None,
) -> ComparisonStudy:
    """Every capture below `source`: its folders, zips and tars, by name.

    A cloud that lies bare among them is a row that says so: it may show a vehicle or a wheel.
    Raises InputError where there is none, or none could be compared.
    """
    paths = sorted(path for path in source.iterdir() if _may_be_capture(path))
    if not paths:
        raise InputError(
            f"{source}: holds neither a capture nor folders, zips or tars of captures: "
            "name the folder they lie in"
        )
    rows = []
    for path in paths:
        progress(path.name)
        rows.append(_row(path, target, config, scanner, request))
    if all(row.found is None for row in rows):
        raise InputError(
            f"{source}: none of its {len(rows)} captures could be compared; the first: "
            f"{rows[0].reason}"
        )
    return ComparisonStudy(str(source), tuple(rows), request.see_rad)


def _may_be_capture(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    packed = path.name.lower().endswith(ARCHIVE_SUFFIXES)
    return path.is_dir() or packed or path.name in clouds_of(path.parent)


def _row(
    path: Path, target: str | None, config: Config, scanner: str | None, request: Request
) -> Row:
    try:
        if path.is_file() and path.name in clouds_of(path.parent):
            raise InputError(
                f"{path}: a cloud without a folder, which may show a whole vehicle or one wheel: "
                "put it in a folder of its own, with a capture.toml"
            )
        with open_capture(path, target) as capture:
            settings = with_scanner(config, scanner or capture.scanner)
            return Row(path.name, validate_capture(capture, settings, request))
    except (WheelplaneError, OSError) as error:
        return Row(path.name, None, " ".join(str(error).split()))
