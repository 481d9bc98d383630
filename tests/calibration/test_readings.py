"""Tests of the table of readings: units, and every fault with its row and column, all at once."""

from __future__ import annotations

import copy
import csv
import math
import pickle
import random
import zipfile
from contextlib import suppress
from pathlib import Path

import openpyxl
import pytest

import wheelplane.calibration
from tests.support.calibration_bay import CAMBER, item_of, machine
from tests.support.wordings import sentences
from wheelplane.calibration.forms.fault import Fault
from wheelplane.calibration.forms.item import Item
from wheelplane.calibration.forms.readings import (
    COLUMNS,
    DIRECTIONS,
    decimal_number,
    read_readings,
    read_texts,
)
from wheelplane.calibration.forms.table_file import FaultyTableError
from wheelplane.errors import InputError, Wording
from wheelplane.report.format.language import load_translations

HEAD = "point,quantity,value,unit,series,repeat,state,direction\n"
ITEM: Item = item_of(machine(camber=CAMBER)).item.model_copy(update={"rim": "400mm"})
MINUTE = math.radians(1 / 60)


def known(kind, point, series):
    return "" if point in ("RR", "1") else f"{point!r} is no wheel or trial of bay: known are RR, 1"


def read(tmp_path, text, name="r.csv", item=ITEM):
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_readings(path, item, known)


def faults(tmp_path, text, name="r.csv"):
    with pytest.raises(FaultyTableError) as error:
        read(tmp_path, text, name)
    assert "; ".join(error.value.faults) == str(error.value)
    return error.value.faults


@pytest.mark.parametrize(
    ("value", "unit", "angle_rad"),
    [
        ("-0.25", "deg", math.radians(-0.25)),
        ("0°15'", "dms", math.radians(0.25)),
        ("-0°00'30\"", "dms", -math.radians(30 / 3600)),
        ("15.5", "min", 15.5 * MINUTE),
        ("75", "min", 75 * MINUTE),
        ("2.5", "mm/m", math.atan(2.5e-3)),
        ("2", "mm", math.asin(2e-3 / 0.4)),
        ("\N{MINUS SIGN}12", "min", -12 * MINUTE),
        (".5", "deg", math.radians(0.5)),
    ],
)
def test_a_value_is_read_in_its_unit(tmp_path, value, unit, angle_rad):
    found = read(
        tmp_path, HEAD + f'RR,toe,"{value.replace(chr(34), chr(34) * 2)}",{unit},1,1,as found,\n'
    )
    (one,) = found.rows
    assert one.value == pytest.approx(angle_rad, rel=1e-12)
    assert (one.point, one.quantity, one.series, one.repeat, one.row) == ("RR", "toe", "1", 1, 2)
    assert (one.state, one.direction) == ("as found", "")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("first", ["", "sep=;\r\n", "SEP=;\n"])
def test_tables_are_read_as_spreadsheets_write_them(tmp_path, encoding, first):
    """With the separator in a first line, and in UTF-16; rows keep their numbers in the file."""
    text = first + HEAD.replace(",", ";") + "RR;toe;1,5;min;1;1;as found;\nRR;toe;x;min;1;2;;\n"
    row = 3 + bool(first)
    path = tmp_path / "r.csv"
    path.write_bytes(text.encode(encoding))
    with pytest.raises(FaultyTableError) as error:
        read_readings(path, ITEM, known)
    assert all(f"row {row}" in fault for fault in error.value.faults)
    path.write_bytes(text.replace(";x;", ";2,5;").replace("2;;", "2;as found;").encode(encoding))
    found = read_readings(path, ITEM, known).rows
    assert [(one.value / MINUTE, one.row) for one in found] == [
        (pytest.approx(1.5), row - 1),
        (pytest.approx(2.5), row),
    ]


def test_a_form_refuses_repeats_in_the_words_of_the_calibration(tmp_path):
    """Two rows of one repeat, however its words are written, are one fault in both."""
    rows = ["RR,toe,1,min,1,1,as found,", "RR,toe,2,min,1,2,as found,",
            "RR,Toe,3,min,1,1,As-Found,", "RR,toe,4,min,1,2,as_found,"]  # fmt: skip
    found = faults(tmp_path, HEAD + "\n".join(rows))
    assert [(one.row, one.column) for one in found] == [(4, "repeat"), (5, "repeat")]
    with pytest.raises(FaultyTableError) as error:
        read_texts(tmp_path / "r.csv")
    assert error.value.faults == found
    (tmp_path / "r.csv").write_text(HEAD + "\n".join(rows[:2]))
    assert len(read_texts(tmp_path / "r.csv")) == 2


def test_a_form_refuses_a_quantity_in_two_units_and_a_row_without_a_place(tmp_path):
    """Each would be lost in a form, where a calibration takes the units as they are."""
    rows = ["RR,toe,,,1,9,as found,", "RR,toe,15,min,1,1,as found,", "1,toe,0.25,deg,1,1,as found,",
            "RR,toe,1,,1,2,as found,", "RR,camber,1,deg,1,1,as found,",
            "RR,camber,1,deg,,2,as found,"]  # fmt: skip
    path = tmp_path / "r.csv"
    path.write_text(HEAD + "\n".join(rows))
    with pytest.raises(FaultyTableError) as error:
        read_texts(path)
    assert error.value.faults == (
        "r.csv: row 7, column series: it is empty: fill it in, or delete the row",
        "r.csv: row 4, column unit: 'deg', but toe is in 'min' in row 3: write all of its "
        "readings in one unit",
        "r.csv: row 5, column unit: '', but toe is in 'min' in row 3: write all of its "
        "readings in one unit",
    )
    assert len(read(tmp_path, HEAD + "\n".join(rows[1:3])).rows) == 2
    path.write_text(HEAD + "\n".join([*rows[:2], rows[4]]))
    assert len(read_texts(path)) == 3


def test_all_faults_of_a_file_are_named_at_once_with_row_and_column(tmp_path):
    rows = [
        "7,toe,1,min,1,1,as found,",
        "RR,toe,1,,1,1,as found,",
        "RR,toe,1,min,1,1,as found,up",
        "RR,toe,2,min,1,1,as found,up",
        "RR,camber,80,deg,1,1,as found,",
        'RR,camber,"1,234",min,1,2,as found,',
        "RR,camber,2,mm,1,3,as found,",
        "RR,caster,2,deg,1,4,as found,",
        "RR,convergence,2,deg,1,5,as found,",
        "RR,camber,about 2,deg,1,6,as found,",
        "RR,camber,,deg,1,7,as found,",
        "RR,camber,1,deg,1,8,found,",
        "RR,camber,1,deg,1,0,as found,",
        "RR,camber,1,deg,1,9,as found,sideways",
        "RR,toe,3,min,1,2,as found,",
    ]
    found = faults(tmp_path, HEAD + "\n".join(rows))
    expected = [
        "r.csv: row 2, column point: '7' is no wheel or trial of bay: known are RR, 1",
        "r.csv: row 3, column unit: it is empty: fill it in, or delete the row",
        "r.csv: row 5, column repeat: 1 of toe at RR stands in row 4 already: number each "
        "repeat once",
        "r.csv: row 6, column value: 80 deg is no plausible camber (at most 20°): check value "
        "and unit",
        "r.csv: row 7, column value: '1,234' may be 1.234 or 1234: write it with a point",
        "r.csv: row 8, column unit: 'mm' is no unit of camber: known are deg, dms, min, mm/m",
        "r.csv: row 9, column quantity: the item file has no [item.caster]: declare it there",
        "r.csv: row 10, column quantity: 'convergence': known are toe, camber, total_toe, "
        "thrust_angle, caster, sai, toe_out_on_turns, setback, track",
        "r.csv: row 11, column value: 'about 2' is no number: write it as -0.25, "
        "its unit in the column unit",
        "r.csv: row 12, column value: it is empty: fill it in, or delete the row",
        "r.csv: row 13, column state: 'found': write 'as found' or 'as left'",
        "r.csv: row 14, column repeat: '0': a whole number from 1 is needed",
        "r.csv: row 15, column direction: 'sideways': write up or down, or leave it empty",
        "r.csv: row 16, column direction: it is empty, but other rows of toe state it: "
        "fill in up or down",
    ]  # fmt: skip
    assert list(found) == expected


def test_rows_without_operator_are_no_operator_of_their_own(tmp_path):
    """Filled in at the first repeat alone, one operator would be two, and their difference in u."""
    head = HEAD.replace("direction", "operator")
    rows = [f"RR,toe,{k},min,1,{k},as found,{'Ana' if k == 1 else ''}" for k in (1, 2, 3)]
    found = faults(tmp_path, head + "\n".join(rows))
    assert found == tuple(
        f"r.csv: row {row}, column operator: it is empty, but other rows of toe in series 1 state "
        "it: fill it in"
        for row in (3, 4)
    )
    apart = ["RR,toe,1,min,1,1,as found,", "RR,toe,1,min,2,1,as found,Ana",
             "RR,toe,1,min,1,1,as left,Rui"]  # fmt: skip
    assert len(read(tmp_path, head + "\n".join(apart)).rows) == 3


@pytest.mark.parametrize("value", ["3 mm", "5mm/m", "0.2in"])
def test_a_value_whose_unit_is_not_that_of_its_column_is_refused(tmp_path, value):
    """Three mm at the rim are no three minutes: one of cell and column is wrong."""
    (fault,) = faults(tmp_path, HEAD + f"RR,toe,{value},dms,1,1,as found,\n")
    assert fault.startswith(f"r.csv: row 2, column value: {value!r}: write degrees, minutes and")


@pytest.mark.parametrize(
    ("head", "fault"),
    [
        (HEAD.replace("value", "valeu"), "column valeu: unknown column: did you mean 'value'?"),
        (HEAD.replace(",unit", ""), "row 1, column unit: the heading lacks it: add the column"),
        (HEAD.replace("direction", "unit"), "row 1, column unit: the heading has it twice"),
    ],
)  # fmt: skip
def test_a_heading_that_cannot_be_used_is_named(tmp_path, head, fault):
    assert any(fault in one for one in faults(tmp_path, head + "RR,toe,1,min,1,1,as found,\n"))


@pytest.mark.parametrize("content", [b"", b"\n\n", b"\xff\xfe", b"PK\x03\x04 no archive", b"\0"])
def test_a_file_that_is_no_table_is_refused_in_one_line(tmp_path, content):
    with pytest.raises(InputError) as error:
        read(tmp_path, content)
    assert str(error.value).startswith("r.csv: ")


def test_a_heading_without_readings_is_refused(tmp_path):
    assert faults(tmp_path, HEAD) == ("r.csv: it has no reading below its heading: enter them",)


def test_decimal_commas_are_read_where_they_are_unambiguous(tmp_path):
    semicolons = HEAD.replace(",", ";") + "RR;toe;12,5;min;1;1;as found;\n"
    assert read(tmp_path, semicolons).rows[0].value == pytest.approx(12.5 * MINUTE)
    quoted = HEAD + 'RR,toe,"12,5",min,1,1,as found,\n'
    assert read(tmp_path, quoted).rows[0].value == pytest.approx(12.5 * MINUTE)
    unquoted = HEAD + "RR,toe,12,5,min,1,1,as found,up\n"
    assert any("put values with a decimal comma in quotes" in f for f in faults(tmp_path, unquoted))
    arc = HEAD + 'RR,toe,"0°12\'30,5""",dms,1,1,as found,\n'
    assert read(tmp_path, arc).rows[0].value == pytest.approx(math.radians(12 / 60 + 30.5 / 3600))


def test_numbers_are_read_as_python_reads_them_and_ambiguous_ones_are_not():
    rng = random.Random(1)
    for _ in range(500):
        number = rng.choice([1, -1]) * round(rng.uniform(0, 3000), rng.randint(0, 5))
        text = repr(number) if abs(number) > 1e-3 else f"{number:.6f}"
        assert decimal_number(text) == pytest.approx(number, rel=1e-15)
        comma = text.replace(".", ",")
        whole, _, rest = comma.lstrip("-").partition(",")
        if len(rest) == 3 and len(whole) <= 3 and not whole.startswith("0"):
            with pytest.raises(ValueError, match="write it with a point"):
                decimal_number(comma)
        else:
            assert decimal_number(comma) == decimal_number(text)
    for text in ("1,234.5", "1.234,5", "1 5", "1e3", "nan", "inf", "--1", ".", ",", "0x1"):
        with pytest.raises(ValueError, match="is no number"):
            decimal_number(text)


def workbook(path, rows):
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    return book, book.active, path


ROWS = [COLUMNS[:8], ["1", "toe", 12.5, "min", 1, 1, "as found", "up"],
        ["RR", "toe", -3, "min", 1, 2, "as found", "down"]]  # fmt: skip


def test_xlsx_and_csv_give_the_same_readings(tmp_path):
    book, _, path = workbook(tmp_path / "r.xlsx", ROWS)
    book.save(path)
    text = "\n".join(",".join(map(str, row)) for row in ROWS)
    found = read_readings(path, ITEM, known).rows
    assert found == read(tmp_path, text).rows
    assert [one.value for one in found] == pytest.approx([12.5 * MINUTE, -3 * MINUTE])


def test_formulas_merged_cells_dates_and_errors_are_named_with_their_place(tmp_path):
    import datetime

    book, sheet, path = workbook(tmp_path / "r.xlsx", ROWS)
    sheet["C2"] = "=1+1"
    sheet["A3"] = datetime.date(2026, 2, 1)
    sheet["H3"] = True
    sheet.append(["RR", "toe", "#DIV/0!", "min", 1, 3, "as found", "up"])
    sheet.merge_cells("E2:E3")
    book.save(path)
    with pytest.raises(FaultyTableError) as error:
        read_readings(path, ITEM, known)
    found = error.value.faults
    assert "r.xlsx: row 2, column series: E2:E3 are merged: unmerge and fill in each cell" in found
    assert "r.xlsx: row 2, column value: a formula: paste it as a value" in found
    assert any("row 3, column point: 2026-02-01" in one and "is a date" in one for one in found)
    assert any("row 3, column direction: True is a date or a truth" in one for one in found)
    assert "r.xlsx: row 4, column value: the error #DIV/0!: enter the reading" in found
    assert len(found) == 5  # a cell that cannot be used is not reported as empty as well


def test_all_faults_of_a_workbook_are_named_at_once_each_in_one_line(tmp_path):
    """Unknown trial, missing unit, duplicate repeat, 80 degrees, comma, merged cells, formula."""
    rows = [
        ["7", "toe", 1, "min", 1, 1, "as found", "up"],
        ["RR", "toe", 1, None, 1, 1, "as found", "up"],
        ["RR", "toe", 1, "min", 1, 1, "as found", "up"],  # repeats a row that has a fault itself
        ["RR", "camber", 80, "deg", 1, 1, "as found", "up"],
        ["RR", "toe", "12,5", "min", 1, 2, "as found", "up"],  # no fault
        ["RR", "toe", "1,234", "min", 1, 3, "as found", "up"],
        ["RR", "toe", "=1+1", "min", 1, 4, "as found", "up"],
        ["RR", "toe", 1, "min", 1, 5, "as found", "up"],
        [None, "toe", 1, "min", 1, 6, "as found", "up"],
        [None, "camber", None, None, 1, 7, "as found", "up"],
    ]
    book, sheet, path = workbook(tmp_path / "r.xlsx", [COLUMNS[:8], *rows])
    sheet.merge_cells("A9:A10")
    book.save(path)
    with pytest.raises(FaultyTableError) as error:
        read_readings(path, ITEM, known)
    places = [(one.row, one.column) for one in error.value.faults]
    assert sorted(places) == [
        (2, "point"), (3, "unit"), (4, "repeat"), (5, "value"), (7, "value"), (8, "value"),
        (9, "point"), (11, "point, value, unit"),
    ]  # fmt: skip
    for one in error.value.faults:
        assert one.startswith(f"r.xlsx: row {one.row}, column {one.column}: ")
        assert ": " in one.fact


@pytest.mark.parametrize(
    "areas", [["A1:XFD1048576"], [f"A{top}:XFD{top + 5}" for top in range(10, 1210, 6)]]
)
def test_large_merged_areas_are_named_before_the_workbook_is_opened(tmp_path, monkeypatch, areas):
    """Opening it takes openpyxl minutes: it makes an object of every merged cell."""
    book, _, path = workbook(tmp_path / "r.xlsx", ROWS)
    book.save(path)
    parts = "".join(f'<mergeCell ref="{area}"/>' for area in areas)
    end = f"</sheetData><mergeCells>{parts}</mergeCells>".encode()
    with zipfile.ZipFile(path) as packed:
        content = {name: packed.read(name) for name in packed.namelist()}
    with zipfile.ZipFile(path, "w") as packed:
        for name, data in content.items():
            packed.writestr(name, data.replace(b"</sheetData>", end))
    monkeypatch.setattr(openpyxl, "load_workbook", None)
    with pytest.raises(FaultyTableError) as error:
        read_readings(path, ITEM, known)
    top = areas[0].split(":")[0][1:]
    assert len(error.value.faults) == len(areas)
    assert error.value.faults[0] == (
        f"r.xlsx: row {top}, column 1: {areas[0]} are merged: unmerge and fill in each cell"
    )


def test_a_sheet_with_a_cell_far_to_the_right_is_refused(tmp_path):
    book, sheet, path = workbook(tmp_path / "r.xlsx", ROWS)
    sheet["XFD3"] = 1
    book.save(path)
    with pytest.raises(InputError, match="16384 columns: give readings only"):
        read_readings(path, ITEM, known)


def test_every_sentence_can_be_said_in_portuguese():
    """Each Wording of the code stands in the English words, by which the Portuguese is found."""
    found = sentences(Path(wheelplane.calibration.__file__).parent)
    found |= {f", {way}" for way in DIRECTIONS}
    english = load_translations("en").section("fault")
    found -= set(load_translations("en").section("note").values())  # doubts
    assert found == set(english.values()) - {english["row"], english["column"]}


def test_a_fault_is_a_line_that_remembers_its_place():
    one = Fault("r.csv", 3, "value", "x is no number")
    assert one == "r.csv: row 3, column value: x is no number"
    assert (one.row, one.column, one.fact) == (3, "value", "x is no number")
    assert Fault("r.csv", None, None, "it is empty") == "r.csv: it is empty"


def test_a_wording_is_its_sentence_and_remembers_its_parts():
    one = Wording("{value}: known are {known}", value="x", known="a, b")
    assert one == "x: known are a, b"
    for same in (one, pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
        assert same == one
        assert (same.template, same.parts["value"]) == ("{value}: known are {known}", "x")


def test_a_workbook_of_two_filled_sheets_is_refused(tmp_path):
    book, _, path = workbook(tmp_path / "r.xlsx", ROWS)
    for row in ROWS:
        book.create_sheet("more") if "more" not in book.sheetnames else None
        book["more"].append(row)
    book.save(path)
    with pytest.raises(InputError, match="2 sheets have content: keep the readings in one"):
        read_readings(path, ITEM, known)


def test_cut_or_spoilt_files_raise_one_line_and_nothing_else(tmp_path):
    rng = random.Random(2)
    book, _, path = workbook(tmp_path / "r.xlsx", ROWS)
    book.save(path)
    text = (HEAD + "RR,toe,1,min,1,1,as found,up\n" * 3).encode()
    for content in (path.read_bytes(), text):
        for _ in range(60):
            spoilt = bytearray(content[: rng.randrange(len(content))])
            for _ in range(rng.randint(0, 5)):
                if spoilt:
                    spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
            with suppress(InputError):
                read(tmp_path, bytes(spoilt))


def test_the_csv_is_what_a_spreadsheet_writes(tmp_path):
    path = tmp_path / "r.csv"
    with path.open("w", newline="", encoding="utf-8-sig") as stream:
        writer = csv.writer(stream)
        writer.writerows([[*COLUMNS[:8]], [], *ROWS[1:], ["", "", "", "", "", "", "", ""]])
    assert [one.row for one in read_readings(path, ITEM, known).rows] == [3, 4]


@pytest.mark.parametrize(
    ("value", "unit", "fact"),
    [
        ("0 03.8", "dms", "'0 03.8': write degrees, minutes and seconds as 0°10'30\", minutes and "
         "seconds below 60"),
        ("54.1", "deg", "54.1 deg is no plausible toe (at most 30°): check value and unit"),
        ("3.8", "gon", "'gon' is no unit of toe: known are deg, dms, min, mm/m, mm"),
    ],
)  # fmt: skip
def test_a_fault_of_many_rows_is_one_line_with_the_first_and_their_number(
    tmp_path, value, unit, fact
):
    """Values differ from row to row; other faults keep their lines, and few rows each theirs."""
    rows = [
        f"RR,toe,{value if k == 0 else value[:-1] + str(k % 9)},{unit},1,{k + 1},as found,"
        for k in range(12)
    ]
    rows[5] = "RR,toe,1,min,1,6,as found,"
    rows.append("9,camber,1,deg,1,1,as found,")
    found = faults(tmp_path, HEAD + "\n".join(rows))
    column = "unit" if unit == "gon" else "value"
    assert found == (
        f"r.csv: row 2, column {column}: {fact} (so in 10 other rows: 3-6, 8-13)",
        "r.csv: row 14, column point: '9' is no wheel or trial of bay: known are RR, 1",
    )
    few = faults(tmp_path, HEAD + "\n".join(rows[:3]))
    assert [one.row for one in few] == [2, 3, 4]


def test_points_without_a_reference_are_named_each(tmp_path):
    rows = [f"{point},toe,1,min,1,1,as found," for point in range(2, 8)]
    found = faults(tmp_path, HEAD + "\n".join(rows))
    assert len(found) == 6
