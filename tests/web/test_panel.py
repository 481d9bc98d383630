"""The panel of a measurement: in every view, what the saved report of that view shows."""

from __future__ import annotations

import cProfile
import pstats
from dataclasses import replace

import numpy as np
import pytest

from tests.support.paths import FIGURE_4
from tests.support.turning import Scene, rolled, swept
from wheelplane.five_point import measure_five_point, read_five_point
from wheelplane.measurement import assess
from wheelplane.measurement.tolerance.model import Tolerance
from wheelplane.report.format.language import LANGUAGES, load_translations
from wheelplane.report.format.report_options import ReportOptions
from wheelplane.report.format.view import CONVENTIONS, STYLES_WITHOUT_RIM
from wheelplane.report.html.page import page_of
from wheelplane.vehicle import AXES
from wheelplane.web.content.measuring import write_results
from wheelplane.web.content.panel import panel, view_of

ZONE = {"lower_deg": -0.5, "upper_deg": 1.0}
LIMITS = {"front": {"toe": ZONE}, "rear": {"toe": ZONE}, "vehicle": {"thrust_angle": ZONE}}


@pytest.fixture(scope="module")
def turned():
    """A measurement with a sweep and a run-out, and its verdicts."""
    made = Scene(seed=3).references()
    swept(made, "FL", 0.08, 0.2, np.radians([-20.0, 0.0, 20.0]))
    rolled(made, "RR", np.radians([0.0, 180.0]))
    measurement = made.measure()
    return measurement, assess(measurement, Tolerance.model_validate(LIMITS))


@pytest.mark.parametrize("language", LANGUAGES)
def test_limits_run_outs_and_labels_are_those_of_the_report_in_every_view(turned, language):
    measurement, conformity = turned
    words = load_translations(language)
    shown = panel(measurement, conformity, words)
    for axis, convention in zip(AXES, CONVENTIONS, strict=False):
        for style in STYLES_WITHOUT_RIM:
            view = view_of(measurement, axis, style, convention)
            saved = page_of(measurement, conformity, ReportOptions(words, view))
            limits, extra, labels = (
                shown[part][convention][axis][style] for part in ("limits", "extra", "labels")
            )
            assert limits["rows"] == [list(row) for row in saved["limits"].rows]
            assert [one["rows"] for one in extra] == [
                [list(row) for row in table.rows] for table, _ in saved["turned"]
            ]
            for wheel in saved["scene"]["wheels"]:
                assert labels[wheel["name"]].items() <= wheel.items()


def test_another_axis_unit_or_convention_is_seen_in_each_part(turned):
    """Signs of headings follow the convention, angles the unit, and toe of a label the axis."""
    shown = panel(*turned, load_translations("en"))
    usual = {
        part: shown[part]["default"]["rear-axle"]["dms"] for part in ("limits", "extra", "labels")
    }
    for part in usual:
        assert shown[part]["default"]["rear-axle"]["deg"] != usual[part]
    assert shown["labels"]["default"]["thrust-line"]["dms"] != usual["labels"]
    values = {
        convention: next(row[3] for row in shown["limits"][convention]["rear-axle"]["deg"]["rows"]
                         if row[2] == "thrust angle")
        for convention in ("default", "iso-8855")
    }  # fmt: skip
    before, after = (float(text.strip("°")) for text in values.values())
    assert before == -after != 0.0


def test_the_quantities_are_listed_as_often_whatever_the_number_of_trials(tmp_path):
    """Each list holds those of all trials: one a trial would grow by the square of their number."""
    points, calls = read_five_point(FIGURE_4), []
    for trials in (1, 4):
        measurement = measure_five_point(replace(points, blocks_m=points.blocks_m[: 4 + trials]))
        out = tmp_path / str(trials)
        out.mkdir()
        profile = cProfile.Profile()
        profile.runcall(write_results, measurement, None, out)
        counted = pstats.Stats(profile).stats.items()
        calls.append(sum(found[0] for (_, _, name), found in counted if name == "stated"))
        assert len(list(out.glob("drawing-*.svg"))) == 2 * (4 + trials)
    assert calls[0] == calls[1]
