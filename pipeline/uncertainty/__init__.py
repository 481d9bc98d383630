"""Uncertainty components, their propagation (JCGM 100) and its Monte Carlo check (JCGM 101)."""

from typing import TYPE_CHECKING

from ..system import loader
from .components import (
    UncertainTarget,
    UncertaintyComponent,
    brightness_component,
    centre_component,
    distance_component,
    mounting_component,
    plane_component,
    vertical_component,
)
from .distributions import (
    binomial_tail,
    box_probability,
    chi_square_beyond,
    chi_square_limits,
    coverage_factor,
    f_beyond,
    f_sum_limits,
    least_tail,
    normal_scores,
    power_of_f,
    power_of_t,
    quantile,
    share_limits,
    tail,
)
from .monte_carlo import TOLERANCE, MonteCarlo, monte_carlo
from .propagation import (
    LEVEL,
    AngleUncertainty,
    Effect,
    effective_dof,
    effects_of,
    propagate,
)
from .scatter import least_squares, scatter_beyond
from .type_b import with_type_b

if TYPE_CHECKING:
    from .field_tests import FieldTests, FoundTerm, evaluate_tests

__all__ = [
    "LEVEL",
    "TOLERANCE",
    "AngleUncertainty",
    "Effect",
    "FieldTests",
    "FoundTerm",
    "MonteCarlo",
    "UncertainTarget",
    "UncertaintyComponent",
    "binomial_tail",
    "box_probability",
    "brightness_component",
    "centre_component",
    "chi_square_beyond",
    "chi_square_limits",
    "coverage_factor",
    "distance_component",
    "effective_dof",
    "effects_of",
    "evaluate_tests",
    "f_beyond",
    "f_sum_limits",
    "least_squares",
    "least_tail",
    "monte_carlo",
    "mounting_component",
    "normal_scores",
    "plane_component",
    "power_of_f",
    "power_of_t",
    "propagate",
    "quantile",
    "scatter_beyond",
    "share_limits",
    "tail",
    "vertical_component",
    "with_type_b",
]

if not TYPE_CHECKING:
    __getattr__ = loader(__name__, {".field_tests": {"FieldTests", "FoundTerm", "evaluate_tests"}})
