"""Tests of `wheelplane calibrate`: from files to results, exit codes, and one line a fault."""

from __future__ import annotations

import csv
import io
import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from tests.support.calibration_bay import TOE, Bay, changed, item_of, machine
from tests.support.paths import CONFIGS
from wheelplane.calibration.calibrate import (
    by_series,
    calibrate,
    calibrate_file,
    calibrate_unfinished,
    why_not_of,
)
from wheelplane.calibration.forms.readings import COLUMNS, read_texts
from wheelplane.calibration.forms.table_file import FaultyTableError
from wheelplane.calibration.forms.template import ITEM_FORM, readings_form
from wheelplane.calibration.reference import Reference
from wheelplane.commands.calibrate import calibrate as command
from wheelplane.errors import InputError
from wheelplane.five_point import measure_five_point, read_five_point
from wheelplane.report.json.calibration import calibration_json
from wheelplane.report.json.measurement import to_json
from wheelplane.report.text.calibration import calibration_text
from wheelplane_synth.machine.forms import item_toml, readings_csv
from wheelplane_synth.machine.indicate import indicate, with_points
from wheelplane_synth.machine.read import read_machine
from wheelplane_synth.output.files import five_point_text

EXAMPLE = CONFIGS / "machines" / "example.toml"
# The five points of a target of 2 m: fine enough to calibrate a machine without a scan.
PENTAGON = 1.0 * np.column_stack(
    [np.cos(2 * np.pi * np.arange(5) / 5), np.sin(2 * np.pi * np.arange(5) / 5)]
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A five-point file of a vehicle with 4 trials, a machine's item file and its readings."""
    path = tmp_path_factory.mktemp("bay")
    bay = Bay(seed=1, trials=4)
    rng = np.random.default_rng(0)
    rows = []
    for normal, centre in zip(bay.car.normals, bay.car.centres, strict=True):
        u = np.cross(normal, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(normal, [0.0, 0.0, 1.0]))
        points = centre + PENTAGON @ np.stack([u, np.cross(normal, u)])
        rows.append(points + rng.normal(0.0, 1e-5, (5, 3)))
    (path / "points.txt").write_text(five_point_text(np.concatenate(rows)))
    tested = with_points(bay.truth, read_machine(EXAMPLE, 0))
    (path / "item.toml").write_text(item_toml(tested))
    (path / "readings.csv").write_text(readings_csv(indicate(bay.truth, tested, rng)))
    return path


def run(*arguments: object):
    found = CliRunner().invoke(command, list(map(str, arguments)), standalone_mode=False)
    if found.exception and not isinstance(found.exception, SystemExit):
        raise found.exception
    return found


def of(folder: Path, *more: object, readings="readings.csv"):
    files = ("--item", folder / "item.toml", "--readings", folder / readings)
    return run(folder / "points.txt", "--five-point", *files, *more)


def test_files_become_results_with_the_planted_errors(folder, tmp_path):
    found = of(folder, "-o", tmp_path / "out")
    assert found.return_value == 0, found.stdout
    tree = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert tree["schema"] == "wheelplane/calibration/1"
    assert tree["decision"] == "conform"
    toe = tree["quantities"][0]
    assert [point["point"] for point in toe["points"]] == ["RR", "RL", "FR", "FL", *"1234"]
    line = toe["characteristic"]
    for known, true in (
        (line["zero_error"], 1.0 / 60.0),
        (toe["hysteresis"], 1.0 / 60.0),
    ):
        assert abs(known["value_deg"] - true) < 2.0 * known["expanded_95_deg"]
    assert abs(line["sensitivity"]["value"] - 1.02) < 2.0 * line["sensitivity"]["expanded_95"]
    text = (tmp_path / "out" / "calibration.txt").read_text()
    assert found.stdout.startswith(text)
    assert "Verdict: CONFORMING" in text


def test_same_files_give_the_same_bytes(folder):
    first, second = of(folder, "--json"), of(folder, "--json")
    assert first.stdout_bytes == second.stdout_bytes
    assert json.loads(first.stdout)["item"]["serial"] == "1"


def numbers(tree: object) -> list[float]:
    """Return all numbers of a tree, in its order."""
    if isinstance(tree, dict | list):
        inner = tree.values() if isinstance(tree, dict) else tree
        return [number for one in inner for number in numbers(one)]
    return [float(tree)] if isinstance(tree, int | float) else []


def test_what_is_measured_already_calibrates_as_its_points_do(folder, tmp_path):
    measured = measure_five_point(read_five_point(folder / "points.txt"))
    (tmp_path / "measurement.json").write_text(to_json(measured))
    files = ("--item", folder / "item.toml", "--readings", folder / "readings.csv", "--json")
    points = json.loads(of(folder, "--json").stdout)
    for source in (tmp_path, tmp_path / "measurement.json"):
        read = json.loads(run(source, *files).stdout)
        found, wanted = numbers(read["quantities"]), numbers(points["quantities"])
        assert len(found) > 100
        assert found == pytest.approx(wanted, rel=1e-6, abs=1e-12)
    with pytest.raises(InputError, match=r"measurement\.json: measured already: leave out"):
        run(tmp_path, *files, "--target", "disc-250")


def test_a_machine_that_does_not_conform_is_exit_code_1(folder):
    item = (folder / "item.toml").read_text()
    (folder / "item.toml").write_text(item.replace('mpe = "6\'"', 'mpe = "1\'"'))
    found = of(folder)
    (folder / "item.toml").write_text(item)
    assert found.return_value == 1
    assert "Verdict: NONCONFORMING" in found.stdout


def test_every_fault_of_the_readings_is_a_line_and_the_exit_code_is_2(folder):
    text = (folder / "readings.csv").read_text().splitlines()
    text[3] = text[3].replace(",min,", ",,")
    text[4] = "9" + text[4][2:]
    (folder / "bad.csv").write_text("\n".join(text))
    files = ("--item", "item.toml", "--readings", "bad.csv")
    ended = subprocess.run(
        [sys.executable, "-m", "wheelplane", "calibrate", "points.txt", "--five-point", *files],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ended.returncode == 2
    assert ended.stdout == ""
    lines = ended.stderr.splitlines()
    assert lines[0] == (
        "wheelplane: bad.csv: row 4, column unit: it is empty: fill it in, or delete the row"
    )
    assert lines[1].startswith("wheelplane: bad.csv: row 5, column point: '9' is no wheel or trial")
    assert len(lines) == 2


def test_the_forms_ask_for_every_trial_and_are_read_when_filled_in(folder, tmp_path):
    forms = tmp_path / "forms"
    source = (folder / "points.txt", "--five-point", "--template", forms)
    found = run(*source, "--item", folder / "item.toml", "--repeats", 2, "--directions")
    assert found.return_value == 0
    assert sorted(path.name for path in forms.iterdir()) == ["readings.csv", "readings.xlsx"]
    head, *rows = (forms / "readings.csv").read_text().splitlines()
    assert len(rows) == (2 * 8 + 2 + 2) * 2 * 2
    filled = [head]
    for number, row in enumerate(rows):
        cells = row.split(",")
        unit, value = ("mm", "1500") if cells[1] == "track" else ("min", str(number % 3))
        cells[2], cells[3] = value, unit
        filled.append(",".join(cells))
    (folder / "filled.csv").write_text("\n".join(filled))
    assert of(folder, readings="filled.csv").return_value == 1  # not its readings, but readable
    with pytest.raises(InputError, match=r"readings\.csv: there already"):
        run(*source, "--item", folder / "item.toml")
    sheet = openpyxl.load_workbook(forms / "readings.xlsx").active
    assert [cell.value for cell in sheet[1]] == head.split(",")
    assert sheet.max_row == len(rows) + 1
    empty = run(folder / "points.txt", "--five-point", "--template", tmp_path / "all")
    assert empty.return_value == 0
    assert (tmp_path / "all" / "item.toml").read_text(encoding="utf-8") == ITEM_FORM


def test_a_form_left_empty_names_every_row(folder, tmp_path):
    run(
        folder / "points.txt",
        "--five-point",
        "--template",
        tmp_path,
        "--item",
        folder / "item.toml",
    )
    (folder / "empty.csv").write_bytes((tmp_path / "readings.csv").read_bytes())
    found = of(folder, readings="empty.csv")
    assert found.return_value == 2
    rows = (2 * 8 + 2 + 2) * 3  # value and unit in one line, which names all of them
    assert found.stderr == (
        "wheelplane: empty.csv: row 2, column value, unit: it is empty: fill it in, or delete the "
        f"row (so in {rows - 1} other rows: 3-{rows + 1})\n"
    )


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        ((), "--item is needed"),
        (("--item", "i.toml"), "--readings is needed"),
        (("--repeats", "3"), "are of --template"),
        (("--template", "f", "--json"), "leave these out"),
    ],
)
def test_arguments_that_do_not_belong_together_are_named(arguments, fault):
    with pytest.raises(InputError, match=fault):
        run("points.txt", *arguments)


def of_series(table, series):
    """The rows of a table of readings as those of another series."""
    head, *rows = csv.reader(table.splitlines())
    column, text = head.index("series"), io.StringIO()
    for row in rows:
        row[column] = series
    csv.writer(text).writerows(rows)
    return text.getvalue()


def test_one_measurement_twice_is_one_reference():
    """As a capture and as its results, whose numbers are rounded: their noise is the same."""
    bay = Bay(seed=2)
    inputs = bay.reference().measurement
    named = replace(inputs.provenance, inputs={"rr.ply": "sha256:1", "rl.ply": "sha256:2"})
    other = replace(inputs.provenance, inputs={"o/rr.ply": "sha256:1", "o/rl.ply": "sha256:3"})
    copy = replace(named, inputs={f"copy/{k}": v for k, v in named.inputs.items()})
    measured = [replace(inputs, provenance=one) for one in (named, other, copy)]
    references = by_series([Reference(one) for one in measured])
    assert [one.series for one in references] == ["1", "2", "3"]
    assert references[2].measurement is references[0].measurement is measured[0]
    assert references[1].measurement is measured[1]


def test_references_in_their_order_are_those_of_the_series(tmp_path):
    bay, tested = Bay(seed=2), machine()
    item = item_of(tested)
    path = tmp_path / "r.csv"
    first = readings_csv(indicate(bay.truth, tested, bay.car.rng))
    path.write_text(first)
    one, two = by_series([bay.reference(), bay.reference()])
    assert (one.series, two.series) == ("1", "2")
    assert by_series([one])[0].series is None
    with pytest.raises(InputError, match="no reading is of series 2, whose reference is"):
        calibrate_file([one, two], item, path)
    path.write_text(first + of_series(first, "2"))
    found = calibrate_file([one, two], item, path)
    assert [record.series for record in found.references] == ["1", "2"]
    why_not = why_not_of([two], item)
    assert why_not("toe", "RR", "1") == ("series '1' has no reference: those given are of series 2")
    with pytest.raises(InputError, match="series '1' has no reference"):
        calibrate_file([two], item, path)
    with pytest.raises(InputError, match="no reference is given"):
        by_series([])


def test_the_record_is_json_for_every_result_and_so_is_the_text():
    """Gauge R&R, several series and as left among them; infinite dof and nan are null."""
    from tests.support.calibration_bay import Protocol, as_readings

    bay = Bay(seed=3)
    toe = changed(TOE, reproducibility=0.5)
    tested = machine(toe=toe, protocol=Protocol(series=2, operators=("Ana", "Rui")))
    rows = [*bay.readings(tested).rows, *as_readings(bay.truth, tested, bay.car.rng, "as left")]
    readings = bay.readings(tested)
    both = type(readings)("r.csv", "sha256:0", tuple(rows))
    found = calibrate([bay.reference()], item_of(tested), both)
    tree = json.loads(calibration_json(found))
    assert len(tree["adjustments"]) == 12
    assert tree["quantities"][0]["gauge_rr"]["appraisers"] == ["Ana", "Rui"]
    point = tree["quantities"][0]["points"][0]
    assert point["reference"]["dof"] is None
    k = point["error"]["k"]
    assert point["error"]["expanded_95_deg"] == pytest.approx(k * point["error"]["u_deg"])
    total = math.fsum(line["u_deg"] ** 2 for line in point["budget"])
    assert total == pytest.approx(point["error"]["u_deg"] ** 2)
    text = calibration_text(found)
    for words in ("Gauge R&R (AIAG)", "As found and as left", "Reproducibility between", "MPE ±6'"):
        assert words in text


def test_the_form_without_an_item_asks_for_the_everyday_quantities():
    columns = readings_form(["RR", "RL", "FR", "FL", "1"], None, 3, False)
    assert set(columns["quantity"]) == {"toe", "camber", "total_toe"}
    assert len(columns["point"]) == 3 * (5 + 5 + 2)
    assert set(columns["value"]) == {""}


def test_unfinished_readings_have_the_faults_and_finished_ones_the_results_of_the_command(tmp_path):
    bay, tested = Bay(seed=2), machine()
    item, path = item_of(tested), tmp_path / "r.csv"
    lines = readings_csv(indicate(bay.truth, tested, bay.car.rng)).splitlines()
    references = by_series([bay.reference()])
    path.write_text("\n".join(lines))
    whole, none = calibrate_unfinished(references, item, path)
    assert none == ()
    assert calibration_json(whole) == calibration_json(calibrate_file(references, item, path))
    path.write_text("\n".join(lines[:8]))  # of the second point a single reading
    part, missing = calibrate_unfinished(references, item, path)
    with pytest.raises(FaultyTableError) as refused:
        calibrate_file(references, item, path)
    assert missing == refused.value.faults
    assert [point.point for point in part.results[0].points] == ["RR"]
    path.write_text("\n".join([*lines, lines[1], lines[2].replace(",min,", ",,")]))
    rest, faults = calibrate_unfinished(references, item, path)
    assert len(faults) == 3  # two repeats, and a unit that is missing
    assert rest.results == whole.results


def test_a_table_of_readings_is_read_as_it_would_be_typed(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["point", "quantity", "value", "unit", "series", "repeat", "state"])
    for repeat, value in enumerate((1e-7, 2.0, 0.1234567890123, -1234567.5, "12,5"), 1):
        book.active.append([1, "toe", value, "min", 1, repeat, "as found"])
    book.save(tmp_path / "r.xlsx")
    rows = read_texts(tmp_path / "r.xlsx")
    written = ["0.0000001", "2", "0.1234567890123", "-1234567.5", "12,5"]
    assert [row[COLUMNS.index("value")] for row in rows] == written
    assert {row[0] for row in rows} == {"1"}
