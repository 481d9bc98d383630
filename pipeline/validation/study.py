"""Comparison study: every capture in a folder compared, or the reason why not."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

from ..capture import clouds_of, is_capture, open_capture
from ..config import Config, with_scanner
from ..errors import InputError, WheelplaneError
from ..files import ARCHIVE_SUFFIXES
from ..system import frozen
from ..uncertainty import binomial_tail
from .agreement import Agreement, agreement, bias_probability
from .comparison import KINDS, AgreementVerdict, Comparison
from .request import Request
from .statistics.power import CONFIDENCE
from .validate_capture import validate_capture

EACH = 1.0 - math.sqrt(CONFIDENCE)  # significance level of each of two tests (Sidak)


@frozen
class Row:
    """Capture of a study: its comparison, or the reason why there is none."""

    name: str
    found: Comparison | None
    reason: str = ""


@frozen
class ComparisonStudy:
    """Comparisons of all captures in a folder, in the order of their names."""

    source: str
    rows: tuple[Row, ...]
    to_detect_rad: float | None

    @property
    def found(self) -> tuple[Comparison, ...]:
        """Comparisons that were made."""
        return tuple(row.found for row in self.rows if row.found is not None)

    @property
    def complete(self) -> bool:
        """Whether every wheel of every capture was compared."""
        return all(row.found is not None and not row.found.missing for row in self.rows)

    @cached_property
    def agreements(self) -> tuple[Agreement, ...]:
        """Agreement of toes and of cambers; empty for fewer than two captures."""
        each = (agreement(self.found, kind) for kind in KINDS)
        return tuple(one for one in each if one is not None)

    @cached_property
    def bias_probability(self) -> float | None:
        """P-value of the mean differences; None for fewer than four vehicles, or captures."""
        return bias_probability(self.found)

    @property
    def disagreeing(self) -> int:
        """Number of captures whose own joint test fails."""
        return sum(not one.joint.agrees for one in self.found)

    @property
    def chance_of_disagreeing(self) -> float:
        """Probability of as many or more, if both methods and uncertainties are correct."""
        return binomial_tail(self.disagreeing, len(self.found), 1.0 - CONFIDENCE)

    @property
    def in_doubt(self) -> tuple[str, ...]:
        """Names of captures that notes put in doubt, or whose centres differ by more than by u."""
        rows = [(row.name, row.found) for row in self.rows]
        return tuple(
            name for name, one in rows if one and (one.doubts or one.is_shape_contradicted)
        )

    @property
    def detectable_rad(self) -> float:
        """Smallest detectable bias of toe or of camber, whichever is larger."""
        return max((one.detectable for one in self.agreements), default=math.inf)

    @property
    def verdict(self) -> AgreementVerdict:
        """Overall verdict: "agree" without bias, and if no more disagree than by chance.

        With a capture in doubt it is "cannot tell" instead, as of that capture alone: what its
        methods share, or their uncertainties do not explain, may be that of the others as well.
        """
        bias = self.bias_probability
        if self.chance_of_disagreeing < EACH or (bias is not None and bias < EACH):
            return "disagree"
        undetectable = self.to_detect_rad is not None and self.detectable_rad > self.to_detect_rad
        return "cannot tell" if bias is None or undetectable or self.in_doubt else "agree"


def is_archive_of_captures(source: Path) -> bool:
    """Return whether `source` is a folder of captures, and not a capture itself.

    A folder with one cloud is a capture; with folders or archives beside it, InputError is raised.
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
            "it may be one capture or a folder of many: give the cloud itself, or move it"
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
    """Compare every capture in `source`: its folders, zips and tars, by name.

    A cloud among them without a folder is a row with that reason: it may show a vehicle or a wheel;
    so is a copy of another, which is not independent of it. Raises InputError where there is no
    capture, or none could be compared.
    """
    paths = sorted(path for path in source.iterdir() if _may_be_capture(path))
    if not paths:
        raise InputError(
            f"{source}: holds neither a capture nor folders, zips or tars of captures: "
            "give the folder that holds them"
        )
    rows: list[Row] = []
    for path in paths:
        progress(path.name)
        rows.append(_unless_copied(_row(path, target, config, scanner, request), rows))
    if all(row.found is None for row in rows):
        raise InputError(
            f"{source}: none of its {len(rows)} captures could be compared; the first: "
            f"{rows[0].reason}"
        )
    return ComparisonStudy(str(source), tuple(rows), request.to_detect_rad)


def _may_be_capture(path: Path) -> bool:
    if path.name.startswith("."):
        return False
    packed = path.name.lower().endswith(ARCHIVE_SUFFIXES)
    return path.is_dir() or packed or path.name in clouds_of(path.parent)


def _unless_copied(row: Row, before: Sequence[Row]) -> Row:
    """Return a row, or the reason why there is none where its scans are those of one before."""
    read = _scans(row)
    copied = next((one.name for one in before if read and _scans(one) == read), None)
    reason = f"it has the scans of {copied}: a copy is no independent comparison: remove it"
    return row if copied is None else Row(row.name, None, reason)


def _scans(row: Row) -> frozenset[str]:
    """Return the checksums of the files of the first method; empty where nothing was compared."""
    if row.found is None or not row.found.origins:
        return frozenset()
    return row.found.origins[0].checksums


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
