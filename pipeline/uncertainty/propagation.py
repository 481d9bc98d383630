"""Uncertainty components propagated to every quantity: covariance and uncertainty budget."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from ..system import frozen
from ..vectors import Array
from ..vehicle import VEHICLE, WHEEL, linearise
from .components import UncertainTarget
from .distributions import coverage_factor

LEVEL = 0.95  # of the expanded uncertainties


@frozen
class AngleUncertainty:
    """All Q quantities of W targets and their uncertainty: radians and metres, k = 1.

    Quantities: for each entry of `definitions.WHEEL` those of all targets, toes first; then the
    entries of `definitions.VEHICLE`. values: (Q,). covariance: (Q, Q). components: names of the
    budget's K lines. contributions: (Q, K) variance by component; they add up to the covariance's
    diagonal. through_frame: (Q,) variance that enters through the four centres. dof: (Q,) effective
    degrees of freedom.
    """

    values: Array
    covariance: Array
    components: tuple[str, ...]
    contributions: Array
    through_frame: Array
    dof: Array

    @cached_property
    def standard(self) -> Array:
        """Standard uncertainties (Q,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance).clip(min=0.0)))

    @cached_property
    def coverage_factor(self) -> Array:
        """Coverage factors (Q,) of 95 %: Student's t of the degrees of freedom."""
        return coverage_factor(LEVEL, self.dof)

    @property
    def toe_rad(self) -> Array:
        """Standard uncertainties (W,) of toe."""
        return self._of_wheels(0)

    @property
    def camber_rad(self) -> Array:
        """Standard uncertainties (W,) of camber."""
        return self._of_wheels(1)

    @property
    def camber_iso_rad(self) -> Array:
        """Standard uncertainties (W,) of ISO camber."""
        return self._of_wheels(2)

    @property
    def vehicle_standard(self) -> dict[str, float]:
        """Standard uncertainties of the vehicle's quantities, by name."""
        return _by_name(self.standard)

    @property
    def vehicle_values(self) -> dict[str, float]:
        """The vehicle's quantities, by name."""
        return _by_name(self.values)

    def wheel_dof(self, index: int) -> dict[str, float]:
        """Return the degrees of freedom of one wheel's angles, by the names of WheelResult."""
        names = ("dof_toe", "dof_camber", "dof_camber_iso")
        rows = self.dof[: -len(VEHICLE)].reshape(len(WHEEL), -1)[: len(names), index]
        return {name: float(dof) for name, dof in zip(names, rows, strict=True)}

    def _of_wheels(self, kind: int) -> Array:
        return np.asarray(self.standard[: -len(VEHICLE)].reshape(len(WHEEL), -1)[kind])


def _by_name(numbers: Array) -> dict[str, float]:
    of_vehicle = numbers[-len(VEHICLE) :].tolist()
    return {entry.name: number for entry, number in zip(VEHICLE, of_vehicle, strict=True)}


def propagate(
    targets: Sequence[UncertainTarget],
    wheels: Sequence[str],
    vertical: UncertainTarget | None = None,
) -> AngleUncertainty:
    """Propagate the uncertainty of W targets to all quantities; the first four: RR, RL, FR, FL.

    vertical: its normal is the direction from which camber is measured; None: the frame's up.

    J Sigma J^T by component: Sigma is the sum over the components of factor factor^T, where a
    shared component acts on all its targets at once.
    Source: JCGM 100 (GUM), 5.2 and G.4 (effective degrees of freedom).
    """
    centres = np.stack([target.centre_m for target in targets[:4]])
    normals = np.stack([target.normal for target in targets])
    linear = linearise(centres, normals, wheels, None if vertical is None else vertical.normal)
    J = linear.slopes
    by_centres = J.reshape(len(J), -1, 6).copy()
    by_centres[:, :, :3] = 0.0
    effects = effects_of(targets if vertical is None else [*targets, vertical])
    names = tuple(dict.fromkeys(effect.name for effect in effects))
    contributions, through_frame = np.zeros((len(J), len(names))), np.zeros(len(J))
    covariance = np.zeros((len(J), len(J)))
    variances = []
    for effect in effects:
        moved = J @ effect.factor
        variances.append(np.sum(moved**2, axis=1))
        covariance += moved @ moved.T
        contributions[:, names.index(effect.name)] += variances[-1]
        through_frame += np.sum((by_centres.reshape(len(J), -1) @ effect.factor) ** 2, axis=1)
    dof = effective_dof(effects, variances, np.diag(covariance))
    return AngleUncertainty(linear.values, covariance, names, contributions, through_frame, dof)


def effective_dof(effects: Sequence[Effect], variances: Sequence[Array], total: Array) -> Array:
    """Return Welch-Satterthwaite degrees of freedom, u^4 / sum(u_i^4 / nu_i).

    The sum runs over the independent estimates; pooled components are one estimate.
    """
    estimates: dict[object, tuple[Array, float]] = {}
    keys = estimates_of(effects)
    for key, effect, variance in zip(keys, effects, variances, strict=True):
        before = estimates[key][0] if key in estimates else 0.0
        estimates[key] = (before + variance, effect.dof)
    fourths = sum((v**2 / dof for v, dof in estimates.values()), np.zeros(len(total)))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(fourths > 0.0, total**2 / fourths, math.inf))


def estimates_of(effects: Sequence[Effect]) -> list[object]:
    """Return for each effect the key of the estimate of its size; pooled ones share theirs."""
    return [effect.name if effect.pooled else index for index, effect in enumerate(effects)]


@frozen
class Effect:
    """A component as it acts on all W targets at once: factor (6 W, k).

    uniform: whether each of its k independent variables is rectangular; else normal or Student's t.
    """

    name: str
    factor: Array
    dof: float
    pooled: bool
    uniform: bool = False


def effects_of(targets: Sequence[UncertainTarget]) -> list[Effect]:
    """Return one effect per component, shared ones combined, in the order of the components."""
    found: dict[tuple[str, object], Effect] = {}
    for index, target in enumerate(targets):
        for component in target.components:
            factor = np.zeros((6 * len(targets), component.factor.shape[1]))
            factor[6 * index : 6 * index + 6] = component.factor
            key = (component.name, index if component.shared is None else component.shared)
            if key in found:
                factor += found[key].factor
            found[key] = Effect(component.name, factor, component.dof, component.pooled)
    return list(found.values())
