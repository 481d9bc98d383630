"""Errors of a scanner from field tests: two faces of targets, and lengths from point to point.

Turning a scanner over (face 2) reverses the errors of its axes, so that half of the difference of
two faces is their sum; lengths of known size show the errors of the range. Least squares over what
the tests can tell apart; what they cannot is left out, and what it may have added to the others is
in their u.
Sources: ASTM E3125 (two-face and point-to-point tests), ISO 17123-9, ISO 10360-13; terms as in
instrument.py.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError, fact_of, remedy_of
from ..vectors import Array

FACES = ("target", "face", "azimuth_deg", "elevation_deg", "range_m")
LENGTHS = ("pair", "measured_m", "reference_m", "u_m", "range_1_m", "range_2_m")
ARCSEC = math.radians(1.0 / 3600.0)
MAX_BYTES = 4 << 20
DISTINCT = 0.2  # share of a term's column that those before it leave, below which it is left out
IN_LINE = 0.1  # of an offset of the ranges in a length, below which it is taken for none
ROUNDED_M = 0.01  # error of the difference of ranges that are given to the centimetre
MOST_M = 1000.0  # the farthest point of a test
LEAST_DOF = 3  # a standard deviation of Student's t needs as many
LEVEL_DEG = 85.0  # elevation beyond which azimuths show nothing
MOST_APART_DEG = 0.5  # of two faces; more is another target
# Standard uncertainty of a beam offset that no ranges show: a judgement, as of an axis that is
# adjusted to half a millimetre.
BEAM_OFFSET_M = 5e-4
ECCENTRICITIES = ("sin a", "cos a", "sin e")  # parts that two faces show
ANGULAR = ("collimation_arcsec", "trunnion_arcsec", "vertical_index_arcsec", *ECCENTRICITIES)


@dataclass(frozen=True)
class TermFit:
    """Terms found by least squares: their values, and covariance, in the units of the file's keys.

    dof: degrees of freedom of the scatter. left_out: terms that the tests cannot tell apart.
    added: (names, left_out) what a unit of each term left out adds to the values.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    dof: int
    left_out: tuple[str, ...]
    added: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def with_left_out(self, u: dict[str, float]) -> TermFit:
        """Return the fit with what the terms left out, of these u, may have added in its u."""
        more = self.added * [u.get(name, 0.0) for name in self.left_out]
        return replace(self, covariance=self.covariance + more @ more.T)


@dataclass(frozen=True)
class FoundTerm:
    """A term of [instrument]: value and u as found; stated: sqrt(value^2 + u^2), for the file.

    Scans are not corrected for the value, so that all of it is uncertainty (JCGM 100, F.2.4.5).
    """

    key: str
    value: float
    u: float

    @property
    def stated(self) -> float:
        """Standard uncertainty for the file."""
        return math.hypot(self.value, self.u)


@dataclass(frozen=True)
class FieldTests:
    """Results of field tests: terms in the order of the file, and those that were not shown."""

    terms: tuple[FoundTerm, ...]
    left_out: tuple[str, ...]
    fits: tuple[TermFit, ...]


def evaluate_tests(paths: Sequence[Path]) -> FieldTests:
    """Evaluate files of two-face and point-to-point tests, by their headings.

    Raises InputError, one line that names file and line.
    """
    fits: list[TermFit] = []
    for path in paths:
        heading, rows = _read(path)
        found = _two_faces(rows, path) if heading == FACES else [_lengths(rows, path)]
        fits += found
    names = [name for fit in fits for name in fit.names]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InputError(
            f"{paths[-1]}: a test of the same kind as another file's: join both in one file"
        )
    unseen_u = _unseen_u(fits)
    fits = [fit.with_left_out(unseen_u) for fit in fits]
    found_values = {
        name: (value, u)
        for fit in fits
        for name, value, u in zip(fit.names, fit.values.tolist(), fit.u.tolist(), strict=True)
    }
    left_out = [name for fit in fits for name in fit.left_out]
    terms, missing = [], []
    for key, parts in KEYS.items():
        seen = [found_values[part] for part in parts if part in found_values]
        unseen = [unseen_u[part] for part in parts if part in left_out and part in unseen_u]
        if seen:
            terms.append(_joined(key, seen, unseen))
        elif set(parts) & set(left_out):
            missing.append(key)
    return FieldTests(tuple(terms), tuple(missing), tuple(fits))


# Keys of [instrument], and the terms that each is fitted by; two of an eccentricity: sine, cosine.
KEYS = {
    "range_bias_m": ("range_bias_m",),
    "range_scale_ppm": ("range_scale_ppm",),
    "collimation_arcsec": ("collimation_arcsec",),
    "trunnion_arcsec": ("trunnion_arcsec",),
    "vertical_index_arcsec": ("vertical_index_arcsec",),
    "azimuth_eccentricity_arcsec": ("sin a", "cos a"),
    "elevation_eccentricity_arcsec": ("sin e", "cos e"),
    "beam_offset_m": ("beam_offset_m",),
}


def _unseen_u(fits: Sequence[TermFit]) -> dict[str, float]:
    """Return the standard uncertainties of the terms that two faces do not show.

    An angle: as large as the parts of eccentricities that were seen, taken for as many draws from
    one normal distribution about 0, so that the unseen one is of Student's t. Of fewer than three
    parts, as large as all errors of the angles that were seen.
    """
    seen = {
        name: value
        for fit in fits
        for name, value in zip(fit.names, fit.values.tolist(), strict=True)
        if name in ANGULAR
    }
    parts = [seen[name] for name in ECCENTRICITIES if name in seen]
    if len(parts) < LEAST_DOF:
        parts = list(seen.values())
    dof = max(len(parts), LEAST_DOF)
    size = math.hypot(*parts) / math.sqrt(dof - 2)
    return {**dict.fromkeys((*ANGULAR, "cos e"), size), "beam_offset_m": BEAM_OFFSET_M}


def _joined(key: str, seen: list[tuple[float, float]], unseen: list[float]) -> FoundTerm:
    """Return a term by its parts; those of an eccentricity that were not seen are 0 with their u.

    unseen: their u.
    """
    if len(seen) + len(unseen) == 1:
        return FoundTerm(key, *seen[0])
    values, u = zip(*seen, strict=True)
    return FoundTerm(key, math.hypot(*values), math.hypot(*u, *unseen))


def fit_terms(
    columns: dict[str, Array],
    observed: Array,
    weight: Array,
    where: str,
    unseen: Sequence[str] = (),
) -> TermFit:
    """Fit observed (N,) by those of the columns (N,) that are distinct from the ones before them.

    weight: (N,) inverse standard deviations, of which the scatter finds the scale. unseen: columns
    that are left out in any case. The covariance is that of Student's t. Raises InputError where
    observations are too few.
    """
    names: list[str] = []
    left_out: list[str] = []
    basis = np.zeros((len(observed), 0))
    for name, column in columns.items():
        if name in unseen:
            left_out.append(name)
            continue
        weighted = weight * column
        rest = weighted - basis @ (basis.T @ weighted)
        size = float(np.linalg.norm(rest))
        if size <= DISTINCT * float(np.linalg.norm(weighted)) or size == 0.0:
            left_out.append(name)
            continue
        names.append(name)
        basis = np.column_stack([basis, rest / size])
    dof = len(observed) - len(names)
    if dof < LEAST_DOF:
        raise InputError(
            f"{where}: {len(observed)} differences are too few for {len(names)} terms: measure "
            f"{LEAST_DOF - dof} more targets or pairs"
        )
    design = np.column_stack([weight * columns[name] for name in names])
    inverse = np.linalg.pinv(design)
    values = inverse @ (weight * observed)
    square = float(np.sum((weight * observed - design @ values) ** 2))
    variance = square / (dof - 2)
    rest = np.reshape([weight * columns[name] for name in left_out], (-1, len(observed))).T
    covariance = variance * inverse @ inverse.T
    return TermFit(tuple(names), values, covariance, dof, tuple(left_out), inverse @ rest)


def _two_faces(rows: list[tuple[int, list[str]]], path: Path) -> list[TermFit]:
    """Fit the errors of the axes to half the differences of both faces, target by target."""
    readings: dict[str, dict[str, list[list[float]]]] = {}
    for line, (target, face, *numbers) in rows:
        where = f"{path}: line {line}"
        if face not in ("1", "2"):
            raise InputError(f"{where}: face is {face!r}: give 1 or 2")
        a, e, r = (
            _number(text, name, where) for text, name in zip(numbers, FACES[2:], strict=True)
        )
        if abs(e) > LEVEL_DEG or r <= 0.0:
            raise InputError(
                f"{where}: an elevation within {LEVEL_DEG:.0f} degrees and a range above 0 are "
                f"needed, got {e:g} and {r:g}"
            )
        readings.setdefault(target, {}).setdefault(face, []).append([a, e, r])
    half, at = [], []
    for target, faces in readings.items():
        if len(faces) < 2:
            raise InputError(
                f"{path}: target {target!r} has face {next(iter(faces))} alone: measure it in both"
            )
        one, two = (np.array(faces[face]) for face in ("1", "2"))
        start = one[0, 0]
        for reading in (one, two):  # azimuths near the first, whatever turn they were given in
            reading[:, 0] = start + (reading[:, 0] - start + 180.0) % 360.0 - 180.0
        apart = one.mean(axis=0) - two.mean(axis=0)
        if max(abs(apart[0]) * math.cos(math.radians(one[0, 1])), abs(apart[1])) > MOST_APART_DEG:
            raise InputError(
                f"{path}: both faces of target {target!r} are {abs(apart[0]):.3g} degrees of "
                f"azimuth and {abs(apart[1]):.3g} of elevation apart: give azimuth and elevation "
                "of face 2 as the scanner exports them, in the sense of face 1"
            )
        half.append(apart[:2] / 2.0 * 3600.0)
        at.append((one.mean(axis=0) + two.mean(axis=0)) / 2.0)
    a, e, r = np.array(at).T
    a, e, ones = np.radians(a), np.radians(e), np.ones(len(at))
    by_azimuth = {
        "collimation_arcsec": 1.0 / np.cos(e),
        "trunnion_arcsec": np.tan(e),
        "beam_offset_m": 1.0 / (r * np.cos(e) * ARCSEC),
        "sin a": np.sin(a),
        "cos a": np.cos(a),
    }
    # The cosine is nearly the index; of a circle off its axis, two faces do not reverse it.
    by_elevation = {"vertical_index_arcsec": ones, "sin e": np.sin(e), "cos e": np.cos(e)}
    across, up = np.array(half).T
    return [
        fit_terms(by_azimuth, across, np.cos(e), str(path)),
        fit_terms(by_elevation, up, ones, str(path), unseen=("cos e",)),
    ]


def _lengths(rows: list[tuple[int, list[str]]], path: Path) -> TermFit:
    """Fit the errors of the range to the lengths of pairs of points.

    Of a length L between points at ranges p and q, an angle g apart, an offset of the ranges makes
    (p + q) (1 - cos g) / L: nothing in line with the scanner, twice itself on either side of it.
    Lengths of one pair are averaged; the uncertainty of its reference is common to them.
    """
    pairs: dict[str, list[list[float]]] = {}
    for line, (pair, *texts) in rows:
        where = f"{path}: line {line}"
        numbers = [
            _number(text, name, where) for text, name in zip(texts, LENGTHS[1:], strict=True)
        ]
        if min(numbers) <= 0.0:
            raise InputError(f"{where}: lengths, ranges and u_m must be above 0")
        _, length, _, one, two = numbers
        if max(length, one, two) > MOST_M:
            raise InputError(
                f"{where}: {max(length, one, two):g} m is farther than a test's points lie: "
                "lengths and ranges are in metres"
            )
        room = ROUNDED_M + 1e-3 * length
        if not abs(one - two) - room <= length <= one + two + room:
            raise InputError(
                f"{where}: a length of {length:g} m cannot lie between points at ranges of "
                f"{one:g} and {two:g} m: check them"
            )
        pairs.setdefault(pair, []).append(numbers)
    repeats = [np.array(numbers) for numbers in pairs.values()]
    more = sum(len(one) - 1 for one in repeats)
    within = sum(float(np.sum((one[:, 0] - one[:, 0].mean()) ** 2)) for one in repeats)
    scatter = within / more if more else 0.0
    means = np.array([one.mean(axis=0) for one in repeats])
    measured, length, u, near, far = means.T
    cosine = ((near**2 + far**2 - length**2) / (2.0 * near * far)).clip(-1.0, 1.0)
    by_offset = (near + far) * (1.0 - cosine) / length
    columns = {
        "range_bias_m": np.where(by_offset > IN_LINE, by_offset, 0.0),
        "range_scale_ppm": 1e-6 * length,
    }
    weight = 1.0 / np.sqrt(u**2 + scatter / np.array([len(one) for one in repeats]))
    return _no_smaller_than_stated(
        fit_terms(columns, measured - length, weight, str(path)), columns, weight
    )


def _no_smaller_than_stated(fit: TermFit, columns: dict[str, Array], weight: Array) -> TermFit:
    """Return the fit with at least the covariance by the stated uncertainties of the lengths."""
    inverse = np.linalg.pinv(np.column_stack([weight * columns[name] for name in fit.names]))
    stated = np.asarray(inverse @ inverse.T)
    larger = fit.covariance if fit.covariance[0, 0] > stated[0, 0] else stated
    return replace(fit, covariance=larger)


def _read(path: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """Return the heading of a file, one of two, and its rows with their lines."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            text = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}: {remedy_of(error)}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text ({fact_of(error)}): save it as UTF-8") from error
    if len(text) > MAX_BYTES:
        raise InputError(f"{path}: it is longer than {MAX_BYTES >> 20} MB: shorten it")
    try:
        table = [
            (number, [cell.strip() for cell in row])
            for number, row in enumerate(csv.reader(io.StringIO(text), strict=True), start=1)
            if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
        ]
    except csv.Error as error:
        raise InputError(f"{path}: not a CSV file ({error}): save it anew") from error
    heading = tuple(table[0][1]) if table else ()
    if heading not in (FACES, LENGTHS):
        raise InputError(
            f"{path}: its first line is no heading of a field test: it must be "
            f"{','.join(FACES)} or {','.join(LENGTHS)}"
        )
    for number, row in table[1:]:
        if len(row) != len(heading):
            raise InputError(
                f"{path}: line {number}: {len(row)} cells, {len(heading)} needed: "
                f"{', '.join(heading)}"
            )
    if len(table) < 2:
        raise InputError(f"{path}: no rows below its heading: add the measurements")
    return heading, table[1:]


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) < 1e6:
        raise InputError(f"{where}: {name} is {text[:40]!r}: a number is needed")
    return value
