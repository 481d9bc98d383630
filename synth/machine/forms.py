"""Files of a machine under test: item.toml, readings.csv, and its truth."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from typing import Any

from ..parameters.machine import Indication, MachineFile
from ..vehicle.steering import INNER_DEG
from .indicate import Indicated, error, true_values

COLUMNS = ("point", "quantity", "value", "unit", "series", "repeat", "state", "direction",
           "operator")  # fmt: skip


def item_toml(machine: MachineFile) -> str:
    """Return the item file, as its owner would declare it. A JSON string is a TOML basic string."""
    lines = ["[item]"]
    identity = machine.identity.model_dump().items()
    lines += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in identity]
    for quantity, table in machine.quantities().items():
        lines += ["", f"[item.{quantity}]", f'resolution = "{_size(table.resolution, quantity)}"']
        if quantity != "track":
            lines.append(f"positive = {json.dumps(table.declared_positive or table.positive)}")
        if quantity in ("toe", "thrust_angle"):
            axis = table.declared_axis or table.axis or "rear-axle"
            lines.append(f'axis = "{axis}"')
        if quantity == "camber":
            lines.append('definition = "elevation"')
        if quantity == "toe_out_on_turns":
            lines.append(f"inner_deg = {INNER_DEG}")
        if table.mpe is not None:
            lines.append(f'mpe = "{_size(table.mpe, quantity)}"')
    lines += ["", "[decision]", f'rule = "{machine.rule}"']
    return "\n".join(lines) + "\n"


def _size(value: float, quantity: str) -> str:
    text = f"{value:.10f}".rstrip("0").rstrip(".")
    return f"{text} mm" if quantity == "track" else f"{text}'"


def readings_csv(readings: Sequence[Indicated]) -> str:
    """Return the table of readings as it would be written down at the machine."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for one in readings:
        unit = "mm" if one.quantity == "track" else "min"
        writer.writerow([one.point, one.quantity, f"{one.value:.10g}", unit, one.series, one.repeat,
                         "as found", one.direction, one.operator])  # fmt: skip
    return text.getvalue()


def machine_truth(truth: Mapping[str, Any], machine: MachineFile) -> dict[str, Any]:
    """Return the machine's errors, and at each point value and error; degrees and metres."""
    return {
        "identity": machine.identity.model_dump(),
        "quantities": {
            quantity: _of_quantity(truth, quantity, table)
            for quantity, table in machine.quantities().items()
        },
    }


def _of_quantity(truth: Mapping[str, Any], quantity: str, table: Indication) -> dict[str, Any]:
    suffix, scale = ("m", 1e-3) if quantity == "track" else ("deg", 1.0 / 60.0)
    names = ("zero", "hysteresis", "repeatability", "reproducibility", "resolution")
    values = true_values(truth, table, quantity)
    return {
        "positive": table.positive,
        "axis": table.axis,
        "gain": table.gain,
        **{f"{name}_{suffix}": getattr(table, name) * scale for name in names},
        "points": {
            point: {
                f"value_{suffix}": value * scale,
                f"error_{suffix}": error(table, value) * scale,
            }
            for point, value in values.items()
        },
    }
