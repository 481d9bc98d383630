"""Errors of a scanner from field tests: two faces of targets, and lengths from point to point.

Turning a scanner over (face 2) reverses the errors of its axes, so that half of the difference of
two faces is their sum; lengths of known size show the errors of the range. Least squares over what
the tests can tell apart; what they cannot is left out, and what it may have added to the others is
in their u.
Sources: ASTM E3125 (two-face and point-to-point tests), ISO 17123-9, ISO 10360-13; terms as in
instrument.py.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..system import frozen
from ..vectors import Array
from .distributions import chi_square_beyond, tail
from .field_tables import ROUNDED_M, FaceTest, LengthTest, read_test

ARCSEC = math.radians(1.0 / 3600.0)
DISTINCT = 0.2  # share of a term's column that those before it leave, below which it is left out
LEAST_DOF = 3  # a standard deviation of Student's t needs as many
OUTLIER = 1e-6  # significance level of the test of all targets or pairs of a file
NO_OUTLIER = 0.01  # of the largest error observed: less is none, however little the others scatter
SCATTER = 1e-3  # significance level of the test of lengths against their u_m
TOO_SMALL = 0.2  # of the stated scatter; less is noted
# Standard uncertainty of a beam offset that no ranges show: a judgement, as of an axis that is
# adjusted to half a millimetre.
BEAM_OFFSET_M = 5e-4
# Standard uncertainty of a range scale that lengths of one size do not show: as of data sheets.
SCALE_PPM = 10.0
ECCENTRICITIES = ("sin a", "cos a", "sin e")  # parts that two faces show
ANGULAR = ("collimation_arcsec", "trunnion_arcsec", "vertical_index_arcsec", *ECCENTRICITIES)


@frozen
class TermFit:
    """Terms found by least squares: their values, and covariance, in the units of the file's keys.

    dof: degrees of freedom of the scatter. left_out: terms that the tests cannot tell apart.
    scatter: of the residuals, in units of their inverse weights. added: (names, left_out) what a
    unit of each term left out adds to the values.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    dof: int
    left_out: tuple[str, ...]
    scatter: float
    added: Array

    @property
    def u(self) -> Array:
        """Standard uncertainties."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def with_left_out(self, u: dict[str, float]) -> TermFit:
        """Return the fit with what the terms left out, of these u, may have added in its u."""
        more = self.added * [u.get(name, 0.0) for name in self.left_out]
        return replace(self, covariance=self.covariance + more @ more.T)


@frozen
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


@frozen
class FieldTests:
    """Results of field tests: terms in the order of the file, and those that were not shown.

    notes: on what looks odd, one sentence each.
    """

    terms: tuple[FoundTerm, ...]
    left_out: tuple[str, ...]
    fits: tuple[TermFit, ...]
    notes: tuple[str, ...] = ()


def evaluate_tests(paths: Sequence[Path]) -> FieldTests:
    """Evaluate files of two-face and point-to-point tests, by their headings.

    Raises InputError, one line that names file and line.
    """
    fits: list[TermFit] = []
    notes: list[str] = []
    for path in paths:
        test = read_test(path)
        if isinstance(test, FaceTest):
            fits += _two_faces(test, str(path))
        else:
            fits.append(_lengths(test, str(path)))
            notes += _notes_on_scatter(fits[-1], str(path))
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
    return FieldTests(tuple(terms), tuple(missing), tuple(fits), tuple(notes))


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
    """Return the standard uncertainties of the terms that the tests do not show.

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
    lengths = {"beam_offset_m": BEAM_OFFSET_M, "range_scale_ppm": SCALE_PPM}
    return {**dict.fromkeys((*ANGULAR, "cos e"), size), **lengths}


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
    labels: Sequence[str] = (),
    unseen: Sequence[str] = (),
) -> TermFit:
    """Fit observed (N,) by those of the columns (N,) that are distinct from the ones before them.

    weight: (N,) inverse standard deviations, of which the scatter finds the scale. labels: of the
    observations, which are then tested for an outlier. unseen: columns that are left out in any
    case. The covariance is that of Student's t. Raises InputError where observations are too few,
    or one is an outlier.
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
    residuals = weight * observed - design @ values
    square = float(np.sum(residuals**2))
    if labels:
        least = NO_OUTLIER * float(np.abs(weight * observed).max())
        _check_outliers(residuals, design @ inverse, dof, labels, least, where)
    variance = square / (dof - 2)
    rest = np.reshape([weight * columns[name] for name in left_out], (-1, len(observed))).T
    covariance = variance * inverse @ inverse.T
    scatter = math.sqrt(square / dof)
    return TermFit(tuple(names), values, covariance, dof, tuple(left_out), scatter, inverse @ rest)


def _check_outliers(
    residuals: Array, hat: Array, dof: int, labels: Sequence[str], least: float, where: str
) -> None:
    """Raise InputError for an observation that the others contradict, by `least` or more.

    Each residual (N,) over the scatter of the others is of Student's t, with one degree of freedom
    less; hat: (N, N). Source: Cook and Weisberg, Residuals and Influence in Regression (1982), 2.2.
    """
    free = (1.0 - np.diag(hat)).clip(min=1e-9)
    squares = residuals**2 / free
    worst = int(np.argmax(squares))
    others = (float(np.sum(residuals**2)) - squares[worst]) / (dof - 1)
    if others <= 0.0 or squares[worst] < least**2:
        return
    off = math.sqrt(squares[worst] / others)
    if 2.0 * len(residuals) * tail(off, dof - 1) < OUTLIER:
        raise InputError(
            f"{where}: {labels[worst]} is {off:.3g} times as far off as the others scatter: check "
            "its numbers, measure it again, or leave it out"
        )


def _two_faces(test: FaceTest, where: str) -> list[TermFit]:
    """Fit the errors of the axes to half the differences of both faces, target by target."""
    a, e, r = test.azimuth_rad, test.elevation_rad, test.range_m
    ones = np.ones(len(a))
    by_azimuth = {
        "collimation_arcsec": 1.0 / np.cos(e),
        "trunnion_arcsec": np.tan(e),
        "beam_offset_m": 1.0 / (r * np.cos(e) * ARCSEC),
        "sin a": np.sin(a),
        "cos a": np.cos(a),
    }
    # The cosine is nearly the index; of a circle off its axis, two faces do not reverse it.
    by_elevation = {"vertical_index_arcsec": ones, "sin e": np.sin(e), "cos e": np.cos(e)}
    return [
        fit_terms(by_azimuth, test.across, np.cos(e), where, test.labels),
        fit_terms(by_elevation, test.up, ones, where, test.labels, unseen=("cos e",)),
    ]


def _lengths(test: LengthTest, where: str) -> TermFit:
    """Fit the errors of the range to the lengths of pairs of points.

    Of a length L between points at ranges p and q, an angle g apart, an offset of the ranges makes
    (p + q) (1 - cos g) / L: nothing in line with the scanner, twice itself on either side of it.
    As much as the rounding of p - q makes of nothing, 1/p + 1/q times that, is none.
    """
    near, far, length = test.near_m, test.far_m, test.reference_m
    cosine = ((near**2 + far**2 - length**2) / (2.0 * near * far)).clip(-1.0, 1.0)
    by_offset = (near + far) * (1.0 - cosine) / length
    in_line = ROUNDED_M * (1.0 / near + 1.0 / far)
    columns = {
        "range_bias_m": np.where(by_offset > in_line, by_offset, 0.0),
        "range_scale_ppm": 1e-6 * length,
    }
    weight = 1.0 / test.u_m
    return _no_smaller_than_stated(
        fit_terms(columns, test.measured_m - length, weight, where, test.labels), columns, weight
    )


def _notes_on_scatter(fit: TermFit, where: str) -> list[str]:
    """Return a note on lengths that scatter otherwise than u_m and repeats explain."""
    beyond = chi_square_beyond(fit.dof * fit.scatter**2, fit.dof)
    fact = f"{where}: the lengths scatter by {fit.scatter:.2g} times what u_m and repeats explain"
    if beyond < SCATTER:
        return [f"{fact}: u follows the scatter; repeat each length, and check u_m."]
    if beyond > 1.0 - SCATTER and fit.scatter < TOO_SMALL:
        return [f"{fact}: u follows u_m; check that it is in metres."]
    return []


def _no_smaller_than_stated(fit: TermFit, columns: dict[str, Array], weight: Array) -> TermFit:
    """Return the fit with at least the covariance by the stated uncertainties of the lengths."""
    inverse = np.linalg.pinv(np.column_stack([weight * columns[name] for name in fit.names]))
    stated = np.asarray(inverse @ inverse.T)
    larger = fit.covariance if fit.covariance[0, 0] > stated[0, 0] else stated
    return replace(fit, covariance=larger)
