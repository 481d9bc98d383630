"""Calibration of caster, SAI and toe-out on turns against measured sweeps: true errors within U."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy import stats

from tests.support.made import DEFAULT, DISC
from tests.support.paths import CONFIGS
from tests.support.turning import Scene, swept
from wheelplane.calibration import (
    QUANTITIES,
    ItemFile,
    Reading,
    Readings,
    Reference,
    load_item,
)
from wheelplane.calibration.calibrate import calibrate, calibrate_file
from wheelplane.capture import open_capture
from wheelplane.config import Config
from wheelplane.measure import measure_capture
from wheelplane_synth.machine.indicate import error, reading
from wheelplane_synth.output.archive import write_capture
from wheelplane_synth.parameters.machine import Indication

# Zero errors of several U, so that a calibration that finds none is wrong.
TABLES = {
    "caster": Indication(
        positive="top-backwards", zero=20.0, gain=0.02, repeatability=0.5, resolution=0.1
    ),
    "sai": Indication(positive="top-in", zero=-150.0, gain=0.01, repeatability=0.5, resolution=0.1),
    "toe_out_on_turns": Indication(
        positive="toe-out", zero=15.0, gain=-0.02, hysteresis=1.0, repeatability=0.5, resolution=0.1
    ),
}
INNER = {"toe_out_on_turns": {"inner_deg": 20.0}}
ITEM = {
    kind: {"resolution": "0.1'", "positive": table.positive, **INNER.get(kind, {})}
    for kind, table in TABLES.items()
}
MINUTE = np.radians(1.0 / 60.0)
SWEEP = np.radians([-20.0, 0.0, 20.0])
SEEDS = 30
OUTSIDE = 1e-3  # probability of failing by chance, on either side


def calibrated(measurement, truth, rng):
    """Errors as found, their U and the true ones, minutes; truth: minutes by quantity and point."""
    rows = [
        Reading(point, kind, reading(TABLES[kind], value, way, rng) * MINUTE, "min", "1", repeat,
                way, "as found", "", 0)
        for kind, points in truth.items() for point, value in points.items()
        for repeat in (1, 2, 3) for way in ("up", "down")
    ]  # fmt: skip
    tables = {kind: ITEM[kind] for kind in truth}
    nameplate = {"maker": "m", "model": "m", "serial": "1", "software": "1"}
    item = ItemFile.model_validate({"item": nameplate | tables})
    found = calibrate([Reference(measurement)], item, Readings("r.csv", "", tuple(rows)))
    points = [point for result in found.results for point in result.points]
    assert [(p.quantity, p.point) for p in points] == [
        (kind, point) for kind, at in truth.items() for point in at
    ]
    return np.array([
        (p.error.value / MINUTE, p.error.expanded / MINUTE,
         error(TABLES[p.quantity], truth[p.quantity][p.point]))
        for p in points
    ])  # fmt: skip


def check_coverage(rows):
    """Check that as many true errors lie within U as 95 % of them may by chance."""
    found, expanded, true = rows.T
    inside = int(np.sum(np.abs(found - true) <= expanded))
    low, high = stats.binom.ppf([OUTSIDE, 1.0 - OUTSIDE], len(rows), 0.95)
    print(f"{inside} of {len(rows)} within U; U {expanded.min():.2g}' to {expanded.max():.2g}'")
    assert low <= inside <= high
    assert np.all(np.abs(found) > expanded)  # no error at all would be wrong everywhere


def test_errors_of_caster_and_sai_cover_the_planted_ones():
    """By rigid-body truth with drawn errors of the scans; discs do not show their rotation."""
    rows = []
    for seed in range(SEEDS):
        rng = np.random.default_rng([seed, 1])
        scene = Scene(seed).references()
        truth = {"caster": {}, "sai": {}}
        for wheel in ("FR", "FL"):
            caster, inclination = np.radians([rng.uniform(2.0, 7.0), rng.uniform(8.0, 15.0)])
            swept(scene, wheel, caster, inclination, SWEEP)
            truth["caster"][wheel], truth["sai"][wheel] = caster / MINUTE, inclination / MINUTE
        rows.append(calibrated(scene.measure(), truth, rng))
    check_coverage(np.concatenate(rows))


@pytest.mark.slow
def test_errors_by_scanned_sweeps_cover_the_planted_ones(tmp_path):
    """From files to errors: saloons with a sweep and run-outs, coarse scans, three quantities."""
    scanner = tmp_path / "coarse.toml"
    scanner.write_text(DEFAULT.read_text().replace("0.0009", "0.004"))
    vehicle, rows = CONFIGS / "vehicles" / "saloon-turning.toml", []
    for seed in range(1, 5):
        folder = tmp_path / str(seed)
        write_capture(
            folder,
            seed=seed,
            vehicle=vehicle,
            scanner=scanner,
            target=DISC,
            trials=0,
            machine=CONFIGS / "machines" / "example.toml",
        )
        made = json.loads((folder / "truth.json").read_text())["machine"]["quantities"]
        with open_capture(folder) as capture:
            reference = Reference(measure_capture(capture, Config()))
        item = load_item(folder / "item.toml")
        found = calibrate_file([reference], item, folder / "readings.csv")
        points = [p for result in found.results for p in result.points if p.quantity in TABLES]
        assert [(p.quantity, p.point) for p in points] == [
            (kind, point) for kind in QUANTITIES if kind in TABLES for point in made[kind]["points"]
        ]
        rows += [
            (p.error.value / MINUTE, p.error.expanded / MINUTE,
             60.0 * made[p.quantity]["points"][p.point]["error_deg"])
            for p in points
        ]  # fmt: skip
    check_coverage(np.array(rows))
