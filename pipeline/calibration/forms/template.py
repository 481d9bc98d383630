"""Empty forms of a calibration: the item's file, and the table of readings for its points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from .item import Item
from .quantities import AXLES, QUANTITIES, TURNS, VEHICLE
from .readings import COLUMNS, DIRECTIONS

FormColumns = dict[str, npt.NDArray[Any]]
EVERYDAY = ("toe", "camber", "total_toe")  # of a form without an item file
FRONT = ("FR", "FL")

ITEM_FORM = """\
# The machine under test: fill in every "", delete the tables of what it does not indicate.
[item]
maker = ""
model = ""
serial = ""
software = ""           # version of its software
# rim = "16in"          # diameter of the rim at which toe in mm is indicated

[item.toe]
resolution = ""         # such as "1'", "0.01°" or "0.1 mm/m"
positive = ""           # toe-in or toe-out
axis = ""               # rear-axle, centreline, thrust-line or side-bisector
# mpe = "4'"            # maximum permissible error, plus or minus
# uncertainty = "2'"    # that the item's maker states (expanded, k = 2), for En

[item.camber]
resolution = ""
positive = ""           # top-out or top-in
definition = ""         # elevation, or iso: as projected across the axis; then also axis = "..."
# vertical = "gravity"  # from which it counts: gravity, floor or wheels (their centres' plane)

[item.total_toe]
resolution = ""
positive = ""           # toe-in or toe-out

# [item.thrust_angle]   # positive = "right" or "left"; axis
# [item.caster]         # positive = "top-backwards" or "top-forwards"; vertical
# [item.sai]            # positive = "top-in" or "top-out"; vertical
# [item.toe_out_on_turns] # positive = "toe-out" or "toe-in"; inner_deg = 20.0
# [item.setback]        # positive = "right-behind" or "left-behind"; axis
# [item.track]          # resolution = "1 mm"

# The decision rule, needed where an mpe is stated:
# [decision]
# rule = "guarded"      # conforming with at least this confidence; undecided near the mpe
# confidence = 0.95
# rule = "simple"       # the error alone decides; the risk is stated
# rule = "shared"       # the same, only where mpe/U is at least this ratio
# ratio = 3.0
"""


def readings_form(
    targets: Sequence[str], item: Item | None, repeats: int, directions: bool
) -> FormColumns:
    """Return the columns of an empty table of readings, to be filled in at the machine.

    targets: names of the reference wheels and trials. item: whose quantities are listed; None:
    EVERYDAY. directions: whether each point is approached upwards and downwards.
    """
    kinds = EVERYDAY if item is None else tuple(item.declared())
    points = {"wheel": tuple(targets), "axle": AXLES, "vehicle": VEHICLE, "turn": TURNS}
    ways = DIRECTIONS if directions else ("",)
    rows = [
        {"point": point, "quantity": kind, "series": "1", "repeat": str(repeat),
         "direction": way, "state": "as found"}
        for kind in kinds
        for point in (FRONT if kind in ("caster", "sai") else points[QUANTITIES[kind].subject])
        for repeat in range(1, repeats + 1)
        for way in ways
    ]  # fmt: skip
    return {column: np.array([row.get(column, "") for row in rows], object) for column in COLUMNS}
