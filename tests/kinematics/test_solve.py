"""Solving a measurement: each axis is fitted once, and reports fit none."""

import numpy as np
import pytest

from tests.support.turning import WHEELS, Scene, rolled, swept
from wheelplane.kinematics import sweep
from wheelplane.kinematics.solve import solve
from wheelplane.report.format.language import load_translations
from wheelplane.report.format.view import PAPER
from wheelplane.report.html.page import ReportOptions, html_report
from wheelplane.report.json.measurement import to_json
from wheelplane.report.text.report import detailed_report

SWEEP = np.radians([-22.0, -10.0, 0.0, 10.0, 22.0])
HALF = np.array([0.0, np.pi])


@pytest.fixture
def fits(monkeypatch):
    """The members of every axis fit from here on."""
    members = []
    original = sweep.SweepScans.fit

    def counted(scans, places, *rest):
        members.append(tuple(places))
        return original(scans, places, *rest)

    monkeypatch.setattr(sweep.SweepScans, "fit", counted)
    return members


def test_each_axle_and_steering_axis_is_fitted_once_and_reports_fit_none(fits):
    scene = Scene(1).references()
    for wheel in WHEELS:
        rolled(scene, wheel, HALF, u_turn=1e-3, with_reference=True)
    for wheel in ("FR", "FL"):
        swept(scene, wheel, 0.07, 0.2, SWEEP, positions=[f"p{i}" for i in range(len(SWEEP))])
    measurement = scene.measure()
    assert len(measurement.runouts) == len(WHEELS)
    assert len(measurement.steering_axes) == len(measurement.toe_out) == 2
    assert len(fits) == len(set(fits)) == len(WHEELS) + 2
    detailed_report(measurement)
    to_json(measurement)
    html_report(measurement, None, ReportOptions(load_translations("en"), PAPER))
    assert len(fits) == len(WHEELS) + 2


def test_a_measurement_without_sweep_or_run_out_stays_as_it_is():
    measurement = Scene(2).references().measure()
    assert solve(measurement) is measurement
    assert (measurement.steering_axes, measurement.runouts, measurement.toe_out) == ((), (), ())
    assert measurement.complete


def test_a_sweep_that_gives_no_axis_is_no_complete_measurement():
    swept(scene := Scene(3).references(), "FL", 0.07, 0.2, np.radians([-20.0, 20.0]))
    measurement = scene.measure()
    assert all(wheel.angles is not None for wheel in measurement.wheels)
    assert not measurement.complete
