"""Copying mistakes at points: do readings fit with the other sign, or exchanged, far better?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..errors import Doubt
from ..measurement import Estimate
from ..system import frozen
from ..uncertainty import quantile
from ..vectors import Array, Mask, Rows
from .conventions import FAR_BETTER, size_text
from .forms.quantities import QUANTITIES

OTHER_SIGN_AT = (
    "{kind}, {state}: the readings at {point} lie {declared} from the line through the other "
    "points, with the opposite sign {found}: look at the signs of its rows, and correct them, or "
    "read the point again."
)
EXCHANGED = (
    "{kind}, {state}: the readings at {point} and {other} lie {declared} from the line through the "
    "other points, exchanged {found}: look at the points of their rows, and correct them, or read "
    "both again."
)
FEWEST, ENOUGH = 2, 4  # other points that show a zero error, and a line
BEYOND = 5.0  # standard uncertainties off the line, so that chance does not explain it
FITS = 3.0  # standard uncertainties
GAIN = 0.1  # standard uncertainty of a slope that few points do not show
WRONG = 4  # of as many other points, one may be wrong as well


@frozen
class _Slip:
    """Points whose readings fit otherwise.

    declared, found: their distances from the others' line as read, and so. misfit: the latter in
    standard uncertainties.
    """

    points: tuple[int, ...]
    declared: float
    found: float
    misfit: float

    @property
    def rank(self) -> tuple[bool, float]:
        """Order of what is looked at first: an exchange that fits explains two points at once."""
        return not (len(self.points) > 1 and self.misfit < FITS), self.misfit


def copying_doubts(
    points: Sequence[str], errors: Sequence[Estimate], references: Array, kind: str, state: str
) -> dict[str, Doubt]:
    """Return the note of each point that was copied with the other sign, or for another point.

    errors, references: of the points, (N,). The best fit is taken first, and its points are left
    out of the line of the others, so that one slip does not let another point look like one.
    """
    x, unit = np.asarray(references, float), QUANTITIES[kind].unit
    e = np.array([one.value for one in errors])
    u = np.array([one.u for one in errors])
    signed = len(QUANTITIES[kind].signs) > 1
    kept, found = np.ones(len(x), bool), dict[str, Doubt]()
    while slips := [*_exchanged(x, e, u, kept), *(_signs(x, e, u, kept) if signed else ())]:
        slip = min(slips, key=lambda one: one.rank)
        kept[list(slip.points)] = False
        names = [points[index] for index in slip.points]
        doubt = Doubt(
            EXCHANGED if len(names) > 1 else OTHER_SIGN_AT,
            kind=kind,
            state=state,
            point=names[0],
            trial=names[0],
            other=names[-1],
            declared=size_text(slip.declared, unit),
            found=size_text(slip.found, unit),
        )
        found |= dict.fromkeys(names, doubt)
    return found


def _exchanged(x: Array, e: Array, u: Array, kept: Mask) -> Iterator[_Slip]:
    """Yield the pairs of points whose readings fit each other's far better."""
    readings, middle = x + e, float(np.median(e))
    for i, j in itertools.combinations(np.flatnonzero(kept).tolist(), 2):
        pair = np.array([i, j])
        exchanged = readings[pair[::-1]] - x[pair]
        if _rms(exchanged - middle) < _rms(e[pair] - middle):
            yield from _better(pair, exchanged, x, e, u, kept)


def _signs(x: Array, e: Array, u: Array, kept: Mask) -> Iterator[_Slip]:
    """Yield the points whose readings fit with the opposite sign far better."""
    for index in np.flatnonzero(kept).tolist():
        turned = np.array([-(x[index] + e[index]) - x[index]])
        yield from _better(np.array([index]), turned, x, e, u, kept)


def _better(
    points: Rows, otherwise: Array, x: Array, e: Array, u: Array, kept: Mask
) -> Iterator[_Slip]:
    """Yield the slip of points whose errors are `otherwise`, if these fit the others far better.

    By distances from the others' line over the standard uncertainty of each: of the error, or the
    scatter of the others about the line where that is more, and of the line.
    """
    others = kept.copy()
    others[points] = False
    if np.count_nonzero(others) < FEWEST:
        return
    line = _line(x[others], e[others])
    about = line.zero + line.slope * x[points]
    typical = max(float(np.median(u[others])), line.scatter)
    scale = np.hypot(u[points].clip(min=line.scatter), line.u(x[points], typical))
    scale = scale.clip(min=np.finfo(float).tiny)
    declared, found = e[points] - about, otherwise - about
    off, misfit = _rms(declared / scale), _rms(found / scale)
    if off > BEYOND and off > FAR_BETTER * misfit:
        yield _Slip(tuple(points.tolist()), _rms(declared), _rms(found), misfit)


@frozen
class _Line:
    """Line of errors over references that a part of wrong points does not move, and its scatter.

    count, mean, spread: number of its points, their mean and the sum of squares about it.
    """

    zero: float
    slope: float
    scatter: float
    count: int
    mean: float
    spread: float

    def u(self, x: Array, typical: float) -> Array:
        """Return the line's standard uncertainty at x; typical: that of one of its points."""
        of_slope = typical / math.sqrt(self.spread) if self.spread else GAIN
        return np.hypot(typical / math.sqrt(self.count), of_slope * (x - self.mean))


def _line(x: Array, e: Array) -> _Line:
    """Fit errors over references by medians; few points show a zero error alone.

    The scatter is that of the points but for the farthest quarter. The slope is the median of those
    of all pairs, weighted by their distances (Sievers 1978).
    """
    count, mean = len(x), float(x.mean())
    spread = float(np.sum((x - mean) ** 2)) if count >= ENOUGH else 0.0
    slope = 0.0
    if spread:
        i, j = np.triu_indices(count, 1)
        apart = x[i] - x[j]
        kept = apart != 0.0
        slopes, weights = (e[i] - e[j])[kept] / apart[kept], np.abs(apart[kept])
        order = np.argsort(slopes)
        half = np.cumsum(weights[order])
        slope = float(slopes[order][np.searchsorted(half, half[-1] / 2.0)])
    left = e - slope * x
    zero = float(np.median(left))
    fitting = count - count // WRONG
    far = float(np.sort(np.abs(left - zero))[fitting - 1])
    scatter = far / quantile(0.5 + (fitting - 0.5) / count / 2.0)
    scatter *= math.sqrt(count / (count - 1 - bool(spread)))
    return _Line(zero, slope, scatter, count, mean, spread)


def _rms(errors: Array) -> float:
    return math.sqrt(float(np.mean(errors**2)))
