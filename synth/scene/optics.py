"""Effects of surfaces on ranges: noise of dark rubber, strays and detours on shiny metal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from .solids import Solid

DETOUR_M = 0.006  # mean detour of light that is reflected twice
STRAY_M = 0.08  # scale of a stray's error


@dataclass(frozen=True)
class Surface:
    """Optics of a material: noise: factor of the range noise; the rest: shares of beams."""

    noise: float = 1.0
    dropout: float = 0.0
    stray: float = 0.0
    multipath: float = 0.0


@dataclass(frozen=True)
class Optics:
    """The same of every facet, each (F,)."""

    noise: Array
    dropout: Array
    stray: Array
    multipath: Array


def optics_of(solids: Sequence[Solid], surfaces: Mapping[str, Surface]) -> Optics:
    """Return the optics of the facets of `solids`, by their materials."""
    plain = Surface()
    known = [surfaces.get(solid.material, plain) for solid in solids]
    facets = [len(solid.faces) for solid in solids]
    columns = ([getattr(one, name) for one in known] for name in vars(plain))
    return Optics(*(np.repeat(np.array(column, dtype=float), facets) for column in columns))
