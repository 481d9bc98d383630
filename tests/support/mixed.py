"""Captures of real wheels, some with a target clamped before them, coarsely scanned."""

from __future__ import annotations

import json
from pathlib import Path

from tests.support.made import DEFAULT, changed
from tests.support.paths import CONFIGS
from wheelplane_synth.output.archive import write_capture

BARE = CONFIGS / "vehicles" / "saloon-bare-wheels.toml"
WHEEL = CONFIGS / "targets" / "wheel.toml"
DISC = CONFIGS / "targets" / "disc-250.toml"
CLAMP = {"clamp_tilt_deg": 0.1, "clamp_shift": 0.001, "stand_off": 0.085, "stand_off_u": 0.001}


def disc_file(folder: Path, **values: object) -> Path:
    """A disc of 250 mm with a clamp as stated, or with these values."""
    return changed(DISC, folder, {**CLAMP, **values})


def write_mixed(
    out: Path, targets: dict[str, Path], seed: int = 1, trials: int = 0, spacing_m: float = 0.002
) -> dict:
    """Write a capture of wheels with these targets, the others bare; return its truth."""
    folder = out.parent / f"{out.name}-files"
    folder.mkdir(parents=True, exist_ok=True)
    scanner = changed(DEFAULT, folder, {"grid.spacing_m": spacing_m, "beam.spot_radius_m": 0.0})
    files = {"vehicle": BARE, "scanner": scanner, "target": WHEEL}
    write_capture(out, seed=seed, trials=trials, targets=targets, **files)
    return json.loads((out / "truth.json").read_text(encoding="utf-8"))
