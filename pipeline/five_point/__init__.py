"""Files of five points per wheel: their fit, their uncertainty, and the estimator of 2013."""

from .components import Station
from .file import FivePointFile, read_five_point
from .fit_block import fit_block
from .observe import observe_block, pooled_noise
from .tcgc_2013 import Tcgc2013Result, tcgc_2013

__all__ = [
    "FivePointFile",
    "Station",
    "Tcgc2013Result",
    "fit_block",
    "observe_block",
    "pooled_noise",
    "read_five_point",
    "tcgc_2013",
]
