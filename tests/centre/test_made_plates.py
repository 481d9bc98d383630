"""Centres of plates that differ from their files as made ones do, before wheels of synth.

Seeds are those of tests/bench/physics. In the first two a step of what lies behind runs a few mm
behind a part of the edge: a footprint of 1.2 mm and another size explain it better than the truth.
Before walls by Lambert's law a chamfer is nearly as likely below 0.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from tests.bench.physics import CASES, SEEDS, made_targets, scanner_file
from wheelplane.capture.open_capture import open_capture
from wheelplane.config import Config, config_file
from wheelplane.measure import measure_capture
from wheelplane_synth.output.archive import write_capture

WHEELS = ("RR", "RL", "FR", "FL")


def squares(folder, case, seed, names, target="disc-250"):
    """Squares of the centres' errors in their planes over their covariances, and footprints."""
    seed += SEEDS * list(CASES).index(case)
    write_capture(
        folder / "capture",
        seed=seed,
        vehicle=config_file("vehicles", "saloon"),
        scanner=scanner_file(folder, CASES[case].values, CASES[case].base),
        target=made_targets(folder, target, CASES[case], seed)["RR"],
        trials=0,
    )
    truth = json.loads((folder / "capture/truth.json").read_text())["wheels"]
    centres = {wheel["name"]: np.array(wheel["centre_m"]) for wheel in truth}
    with open_capture(folder / "capture", target) as capture:
        measured = measure_capture(capture, Config())
    for wheel in measured.wheels:
        fitted = wheel.observation.fitted
        if wheel.observation.name in names:
            axes = np.linalg.svd(fitted.normal[None, :])[2][1:]
            off = axes @ (fitted.centre_m - centres[wheel.observation.name])
            covariance = axes @ fitted.centre_covariance_m2 @ axes.T
            yield off @ np.linalg.solve(covariance, off), fitted.edge_fit.spot_m


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "name"), [(12, "FL"), (13, "RR")])
def test_a_step_close_behind_the_edge_makes_no_smaller_footprint(tmp_path, seed, name):
    ((square, spot_m),) = squares(tmp_path, "quiet", seed, [name])
    assert square < stats.chi2.isf(1e-3, 2)
    assert spot_m == pytest.approx(0.0015, abs=5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4])
def test_a_chamfer_before_lambert_s_walls_is_in_the_uncertainty(tmp_path, seed):
    found = [square for square, _ in squares(tmp_path, "lambert", seed, WHEELS)]
    assert np.sum(found) < stats.chi2.isf(1e-3, 2 * len(found))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "target"),
    [
        ("quiet", "rectangle-360x240"),
        ("quiet", "pattern-circles"),
        ("strongest", "disc-250"),
    ],
)
def test_a_chamfer_that_no_fit_shows_is_in_the_uncertainty(tmp_path, case, target):
    """Where a part of a side has no background, and where intensities show the edge.

    Without its share, squares of up to 17 and 200 a wheel.
    """
    found = [square for square, _ in squares(tmp_path, case, 1, WHEELS, target)]
    assert np.sum(found) < stats.chi2.isf(1e-3, 2 * len(found))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [13, 22])
def test_a_round_that_is_darker_is_no_footprint(tmp_path, seed):
    """Where intensities of laser profiles fade by the edge's form, depths show it.

    By intensities the first of these was refused, as of a target 0.9 mm larger. A centre of the
    other one, 0.17 mm smaller than stated, was off by 0.1 mm.
    """
    found = list(squares(tmp_path, "line-profile", seed, WHEELS))
    assert sum(square for square, _ in found) < stats.chi2.isf(1e-3, 2 * len(found))
    assert max(spot_m for _, spot_m in found) < 5e-4
