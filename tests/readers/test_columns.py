"""Columns by name and unit, columns without names, and the lines above a table, without a file."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.sources import opened
from wheelplane.errors import InputError
from wheelplane.readers.options import KNOWN_COLUMNS, ReadOptions
from wheelplane.readers.parsing import heading as text_headings
from wheelplane.readers.parsing.ascii import is_label, is_missing, is_prose
from wheelplane.readers.parsing.columns import (
    INTENSITIES,
    are_known,
    check_unnamed,
    find_layout,
    unit_of,
)
from wheelplane.readers.parsing.heading import named_layout, read_heading
from wheelplane.readers.source import Layout

NAMES = {
    "x y z": Layout((0, 1, 2), None),
    "Z,Y,X,I": Layout((2, 1, 0), 3),
    "intensity,i,x,y,z": Layout((2, 3, 4), 0),
    "x,y,z,height,elevation": Layout((0, 1, 2), None),
    "easting,northing,elevation,x": Layout((0, 1, 2), None),
    "nx,ny,nz,x,y,z": Layout((3, 4, 5), None),
    "points_2,points_1,points_0": Layout((2, 1, 0), None),
    "X [m],Y (m),Z_m": Layout((0, 1, 2), None, "m"),
    "x / mm,y in mm,z mm": Layout((0, 1, 2), None, "mm"),
    "X[µm],Y[um],Z[micron]": Layout((0, 1, 2), None, "µm"),
    "x_in,y [inches],z (inch)": Layout((0, 1, 2), None, "in"),
    "x [furlong],y,z": Layout((0, 1, 2), None, "furlong"),
    "PosX,PosY,PosZ": Layout((0, 1, 2), None),
    "x_coord,y_coord,z_coord,time_s": Layout((0, 1, 2), None),
    "x [],y,z": Layout((0, 1, 2), None),
}


@pytest.mark.parametrize("names", NAMES)
def test_columns_are_found_by_name(names):
    words = names.split(",") if "," in names else names.split()
    assert find_layout(words) == NAMES[names]


@pytest.mark.parametrize(
    ("names", "says"),
    [
        ("x,y", "z is missing among the columns x, y"),
        ("x,x,y,z", "x is there 2 times"),
        ("northing,easting", "x is missing"),
        ("easting,northing", "x is missing"),
        ("x [m],y [mm],z [m]", "have the units m, mm"),
        ("x [deg],y [deg],z [m]", "have the units deg, m"),
        ("row,col,depth", "x is missing"),
    ],
)
def test_columns_that_are_not_found(names, says):
    with pytest.raises(ValueError, match=says):
        find_layout(names.split(","))


def test_units_are_words():
    assert [unit_of(word) for word in ("m", "[MM]", '"in"', "Inches", " cm ", "μm", "nm")] == [
        *("m", "mm", "in", "in", "cm", "µm", "nm")
    ]
    assert [unit_of(word) for word in ("", "-", "s", "deg", "1")] == [None] * 5


def test_names_that_are_known_are_no_prose():
    assert are_known(["Y", "X", "Z", "Intensity"])
    assert are_known(sorted(KNOWN_COLUMNS))
    assert are_known(sorted({*KNOWN_COLUMNS, *INTENSITIES}))
    assert not are_known(["rotate", "x", "y", "z"])
    assert not are_known(["x", "y"])
    assert ReadOptions(("ID", "X", "Y", "Z", "-", "-")).columns is not None


def unnamed(tmp_path, table):
    with opened(tmp_path, b"1") as source:
        check_unnamed(np.asarray(table, float), source)


RNG = np.random.default_rng(0)
SOMEWHERE = RNG.normal(size=(50, 4))
COUNT = np.arange(50.0)


@pytest.mark.parametrize(
    ("first", "says"),
    [
        ([COUNT // 10, COUNT % 10], "two columns are whole .*--columns row,col,x,y,z,- or"),
        ([COUNT % 10, COUNT // 10], "two columns are whole"),
        ([COUNT // 10 + 2000, COUNT % 10 * 7], "two columns are whole"),
        ([np.full(50, 3.0), COUNT * 2 % 17], "two columns are whole"),
        ([COUNT + 7], "counts the rows.*--columns -,x,y,z,- or, .* --columns x,y,z,-,-"),
        ([np.cumsum(RNG.integers(1, 9, 50))], "first column is a rising whole number"),
    ],
)  # fmt: skip
def test_a_raster_or_an_index_in_front_is_refused(tmp_path, first, says):
    with pytest.raises(InputError, match=says):
        unnamed(tmp_path, np.column_stack([*first, SOMEWHERE]))


@pytest.mark.parametrize(
    "table",
    [
        SOMEWHERE,
        np.round(SOMEWHERE * 1000),  # whole millimetres
        np.column_stack([COUNT % 10, COUNT // 10, SOMEWHERE[:, 0]]),
        np.column_stack([np.round(SOMEWHERE[:, :2] * 99), SOMEWHERE]),  # signs: coordinates
        np.column_stack([SOMEWHERE[:, :2], COUNT, COUNT]),
        np.column_stack([COUNT, COUNT, COUNT, COUNT]),
        np.column_stack([COUNT, SOMEWHERE])[:2],  # too few rows to tell
        np.column_stack([COUNT[::-1], SOMEWHERE]),
    ],
)
def test_coordinates_are_not_taken_for_a_raster(tmp_path, table):
    unnamed(tmp_path, table)


PROSE = ["Point cloud export", "LJ-X8000", "[Data]", "Offset: 1 2 3", "pitch 0.05 mm", "-----"]
PROSE += ["; settings", "Größe 7", "Scan\tof\twheel", "{", "X pitch = 0.05", "caf\ufffd 3"]
ROWS = [
    "1 2 3",
    "1.0 2.0",
    "x 2 3",
    "k.1 0.5 0.6",
    "\x00abc",
    "P1 1 2 3",
    "abc 1 2 3",
    "-1,2",
    "x9",
    '"3.61","1.61","0.00ab.000"',
    "'1.5' '2.5' 'abc'",
]


@pytest.mark.parametrize("line", PROSE)
def test_text_around_a_table_is_prose(line):
    assert is_prose(line)
    assert is_prose(line, 4, ",")


@pytest.mark.parametrize("line", ROWS)
def test_what_may_have_been_a_row_is_no_prose(line):
    assert not is_prose(line)


def test_prose_of_as_many_cells_as_a_row_may_hold_one_number():
    assert is_prose("abc def 3", 3)
    assert not is_prose("abc 2 3", 3)
    assert is_prose("abc 2 3", 4)


def test_a_label_is_a_name_and_no_number():
    assert [is_label(cell) for cell in ("P1", "rr", "1.2.2026x", "ä")] == [True] * 4
    assert not any(map(is_label, ("1", "1,5", "nan", "-nan(ind)", "", "N/A", "1.2.3", "-")))
    assert all(map(is_missing, ("", "N/A", "null", "--", "-nan(ind)")))
    assert not any(map(is_missing, ("-", "0", "x", "n", "nan")))


def heading_of(tmp_path, text):
    with opened(tmp_path, text.encode()) as source:
        heading = read_heading(source)
        return heading, named_layout(heading, source)


@pytest.mark.parametrize("delimiter", [" ", ",", ";", "\t"])
@pytest.mark.parametrize("gaps", [0, 3])
def test_the_lines_above_the_rows(tmp_path, delimiter, gaps):
    gap = delimiter.join(["N/A"] * 4) + "\n\n"
    text = (
        "\n# made\nExport of a wheel scan\n4\n"
        + gap * gaps
        + delimiter.join("1234")
        + "\n5 6 7 8\n"
    )
    heading, named = heading_of(tmp_path, text)
    assert named is None
    assert (heading.lines, heading.comments) == (((3, "Export of a wheel scan"),), ("made",))
    assert (heading.declared, heading.cells) == (4, ("1", "2", "3", "4"))
    assert (heading.line, heading.first[0]) == (5, 5 + 2 * gaps)
    assert heading.rows_from == gap * gaps + delimiter.join("1234") + "\n"


def test_as_many_words_as_columns_may_be_their_names(tmp_path):
    """Range, azimuth, zenith: taken for x y z they would be a wrong angle without a word."""
    with pytest.raises(InputError, match="x is missing among the columns Range, Azimuth, Zenith"):
        heading_of(tmp_path, "Range Azimuth Zenith\n1 2 3\n")


def test_names_stand_anywhere_above_the_rows_and_units_below_them(tmp_path):
    _, named = heading_of(tmp_path, "made by hand\ny;x;z\nmm;mm;mm\n------\n1;2;3\n")
    assert named == (3, Layout((1, 0, 2), None, "mm"))
    _, named = heading_of(tmp_path, '"X","Y","Z"\n1 2 3\n')  # another delimiter than the rows'
    assert named == (3, Layout((0, 1, 2), None))
    _, named = heading_of(tmp_path, "// z y x\n1 2 3\n")
    assert named == (3, Layout((2, 1, 0), None))
    _, named = heading_of(tmp_path, "// z y x\nx y z\n1 2 3\n")  # names before comments
    assert named == (3, Layout((0, 1, 2), None))


WHOLE = np.round(RNG.uniform(0.0, 900.0, (50, 4)))
RISING = np.cumsum(RNG.integers(1, 9, 50)).astype(float)
RASTER = {
    "row, column, x y z": [COUNT // 10, COUNT % 10, SOMEWHERE[:, :3]],
    "row, column, x y z in whole millimetres": [COUNT // 10, COUNT % 10, WHOLE[:, :3]],
    "column, row, x y z in whole millimetres": [COUNT % 10, COUNT // 10, WHOLE[:, :3]],
    "three rows, column, x y z in whole millimetres": [COUNT // 3, COUNT % 3, WHOLE[:, :3]],
    "any row and column, and an intensity": [WHOLE[:, :2], SOMEWHERE[:, :3], WHOLE[:, 0]],
    "an index, and an intensity": [RISING, SOMEWHERE[:, :3], WHOLE[:, 0]],
    "a count, and whole x y z of which one has steps of one": [COUNT, COUNT // 2, WHOLE[:, :2]],
}
POINTS = {
    "the diagonal": [COUNT, COUNT, SOMEWHERE[:, :2]],
    "x and y in whole numbers, x rising": [RISING, WHOLE[:, 0], SOMEWHERE[:, :2]],
    "x and z in whole numbers, x rising": [RISING, SOMEWHERE[:, :2], WHOLE[:, 0]],
    "x in whole numbers": [WHOLE[:, 0], SOMEWHERE[:, :3]],
    "x in steps": [COUNT // 2, SOMEWHERE[:, :3]],
    "x that is whole at times": [np.where(COUNT % 3, RISING, RISING + 0.5), SOMEWHERE[:, :3]],
    "y in whole numbers": [np.abs(SOMEWHERE[:, 0]), WHOLE[:, 0], SOMEWHERE],
    "x y z in whole numbers, of which one is a number more": [WHOLE[:, :3], SOMEWHERE[:, :2]],
}


@pytest.mark.parametrize("name", RASTER)
@pytest.mark.parametrize("rows", [3, 50])
def test_indices_are_known_whatever_follows_them(tmp_path, name, rows):
    table = np.column_stack(RASTER[name])[:rows]
    with pytest.raises(InputError, match="and no column has a name"):
        unnamed(tmp_path, table)
    unnamed(tmp_path, table[:2])


@pytest.mark.parametrize("name", POINTS)
def test_whole_coordinates_are_no_indices(tmp_path, name):
    unnamed(tmp_path, np.column_stack(POINTS[name]))


@pytest.mark.parametrize("gap", ["N/A N/A N/A", "-- null n/a"])
def test_rows_of_three_cells_without_a_value_are_rows(tmp_path, gap):
    heading, _ = heading_of(tmp_path, f"Export made by hand\n{gap}\n1 2 3\n")
    assert (heading.line, heading.first[0]) == (2, 3)


def test_two_marks_are_no_row(tmp_path):
    heading, _ = heading_of(tmp_path, "Export made by hand\n-- --\n1 2 3\n")
    assert (heading.line, heading.first[0]) == (3, 3)
    assert [text for _, text in heading.lines] == ["Export made by hand", "-- --"]


def test_the_last_line_above_the_rows_that_is_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(text_headings, "_MOST_LINES_BEFORE", 3)
    assert heading_of(tmp_path, "Export made by hand\n\n1 2 3\n")[0].line == 3
    with pytest.raises(InputError, match="more than 3 lines before its points"):
        heading_of(tmp_path, "Export made by hand\n\n\n1 2 3\n")


def test_names_of_more_columns_in_a_comment_are_no_matter_where_x_y_z_come_first(tmp_path):
    assert heading_of(tmp_path, "// X Y Z intensity\n1 2 3\n")[1] is None
    with pytest.raises(InputError, match="4 columns are named in 'y x z intensity'"):
        heading_of(tmp_path, "// y x z intensity\n1 2 3\n")


@pytest.mark.parametrize("below", ["x9\nmm;mm;mm\n", "mm;mm;mm\nx9\n", "mm;mm;mm\nby hand\nx9\n"])
def test_a_damaged_row_near_the_units_is_refused(tmp_path, below):
    with pytest.raises(InputError, match="is neither a row of numbers nor a heading: 'x9'"):
        heading_of(tmp_path, f"y;x;z\n{below}1;2;3\n")


@pytest.mark.parametrize("names", ["Range - Zenith", "Range;;Zenith"])
def test_words_with_a_gap_may_be_names(tmp_path, names):
    rows = "1;2;3\n" if ";" in names else "1 2 3\n"
    with pytest.raises(InputError, match="x is missing among the columns Range"):
        heading_of(tmp_path, f"{names}\n{rows}")


def test_marks_and_other_words_are_no_names(tmp_path):
    for line in ("--- --- ---", "Export of a wheel scan", "Scan 7", "Scan 7 now"):
        assert heading_of(tmp_path, f"{line}\n1 2 3\n")[1] is None
