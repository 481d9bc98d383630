"""Results as `batch` writes them, made of a real measurement with other numbers."""

from __future__ import annotations

import copy
import functools
import hashlib
import json
from pathlib import Path

from wheelplane.five_point import measure_five_point
from wheelplane.five_point.file import read_five_point
from wheelplane.report.json.measurement import to_tree

PAPER = Path(__file__).resolve().parents[1] / "data" / "paper" / "figure-4.txt"


@functools.cache
def _measured() -> dict:
    return to_tree(measure_five_point(read_five_point(PAPER)))


def result(name: str, *, status="ok", vehicle="car", date=None, stage="", reason="", **values):
    """A result's tree; values: by "RR toe" the angle of a wheel, else a quantity of the vehicle.

    A number, or a pair of number and standard uncertainty, degrees or metres.
    """
    tree = copy.deepcopy(_measured())
    tree |= {"capture": name, "vehicle_name": vehicle}
    if status in ("failed", "quarantined"):
        tree |= {"wheels": [], "frame": None, "vehicle": {}}
    for quantity, given in values.items():
        value, u = given if isinstance(given, tuple) else (given, 0.003)
        wheel, _, angle = quantity.rpartition("_")
        if angle in ("toe", "camber"):
            (found,) = [w for w in tree["wheels"] if w["name"] == wheel]
            found |= {f"{angle}_deg": value, f"u_{angle}_deg": u}
        else:
            tree["vehicle"] |= {quantity: value, f"u_{quantity}": u}
    tree["provenance"]["inputs"] = {"five-point.txt": f"sha256:{key_of(name)}"}
    tree["batch"] = {
        "key": key_of(name),
        "kind": "five-point",
        "date": date,
        "status": status,
        "stage": stage,
        "reason": reason,
        "config_sha256": "c" * 64,
    }
    return tree


def key_of(name: str) -> str:
    """The key of the capture of this name."""
    return hashlib.sha256(name.encode()).hexdigest()


def place(key: str) -> str:
    """The name of a result's JSON in its store."""
    return f"measurements/{key[:2]}/{key}.json"


def text(tree: dict) -> bytes:
    """A result as its file has it."""
    return (json.dumps(tree, indent=1, ensure_ascii=False) + "\n").encode()


def add(store, *trees) -> None:
    """Write results, replacing what is there."""
    for tree in trees:
        store.write(place(tree["batch"]["key"]), text(tree))
