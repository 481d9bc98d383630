"""Captures by a structured-light camera: clean edges, no footprint, a shadow beside each target."""

from __future__ import annotations

import numpy as np
import pytest

from wheelplane.capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.measure import measure_capture
from wheelplane_synth.output.archive import write_capture

PIXEL_M = 5e-4


@pytest.mark.slow
def test_no_target_of_its_stated_size_is_refused(tmp_path):
    """Square to a target, what a scanner reports may undo any size: one of 4 mm more had u 0.3."""
    names = {"vehicle": "saloon", "scanner": "structured-light", "target": "disc-250"}
    files = {kind: config_file(f"{kind}s", name) for kind, name in names.items()}
    write_capture(tmp_path / "capture", seed=1, **files, trials=0)
    with open_capture(tmp_path / "capture", "disc-250") as capture:
        found = measure_capture(capture, Config())
    assert [wheel.observation.status for wheel in found.wheels] == ["ok"] * 4
    for wheel in found.wheels:
        assert np.trace(wheel.observation.fitted.centre_covariance_m2) < 2.0 * (PIXEL_M / 10.0) ** 2
