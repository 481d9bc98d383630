"""Reading of a machine file, whose ranges are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..parameters.machine import INDICATED, Identity, Indication, MachineFile, Protocol
from ..parameters.recipe import read_recipe


def read_machine(path: Path, seed: int) -> MachineFile:
    """Read a machine file and draw its ranges. Raises SynthError."""
    recipe = read_recipe(path, MachineFile)
    rng = np.random.default_rng((seed, 18))
    tables = {name: recipe.draw(name, Indication, rng) for name in INDICATED if name in recipe.tree}
    return MachineFile(
        identity=recipe.draw("identity", Identity, rng),
        protocol=recipe.draw("protocol", Protocol, rng),
        rule=recipe.tree.get("rule", "guarded"),
        **tables,
    )
