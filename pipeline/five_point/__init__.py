"""Files of five points per wheel: their fit, their uncertainty, and the estimator of 2013."""

from .check_blocks import BlockCheck, check_blocks, check_radius
from .components import Station
from .file import FivePointFile, read_five_point
from .fit_block import fit_block
from .measure import measure_five_point
from .observe import observe_block, pooled_noise
from .pentagon import fit_pentagon
from .tcgc_2013 import Tcgc2013Result, tcgc_2013

__all__ = [
    "BlockCheck",
    "FivePointFile",
    "Station",
    "Tcgc2013Result",
    "check_blocks",
    "check_radius",
    "fit_block",
    "fit_pentagon",
    "measure_five_point",
    "observe_block",
    "pooled_noise",
    "read_five_point",
    "tcgc_2013",
]
