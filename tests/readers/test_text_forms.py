"""Text as exporters write it: missing values, names and units, what stands around the rows."""

from __future__ import annotations

import codecs

import numpy as np
import pytest

from wheelplane.errors import InputError
from wheelplane.readers import ReadOptions, read_scan
from wheelplane.units import LENGTH_UNITS

POINTS = np.round(np.random.default_rng(7).uniform(-2, 2, (6, 3)), 4)
SHADES = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]


def rows(delimiter=" ", *, shades=True, before="", behind=""):
    lines = []
    for number, (point, shade) in enumerate(zip(POINTS, SHADES, strict=True)):
        cells = [f"{x:.4f}" for x in point] + [f"{shade:.1f}"] * shades
        lines.append(before.format(number) + delimiter.join(cells) + behind.format(number))
    return "".join(line + "\n" for line in lines)


def read(folder, data, name="rr.txt", options=None, **given):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_scan(path, given.pop("unit", "m"), name, options or ReadOptions(**given))


def refuse(folder, data, pattern, name="rr.txt", **given):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, data, name, **given)
    assert str(caught.value).startswith(f"{name}: ")
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


SIGNS = ["1.#QNAN", "-1.#IND", "1.#INF", "-1.#INF", "1.#QNAN0", "1.#INF00", "-1.#IND000", "1.#QO"]
SIGNS += ["1.#R", "-1.#J", "1.#IO", "1.#SNAN"]
NONES = ["nan", "-nan", "NaN", "-nan(ind)", "nan(snan)", "N/A", "n/a", "NA", "null", "#N/A", "--"]


@pytest.mark.parametrize("none", SIGNS + NONES)
@pytest.mark.parametrize("delimiter", [" ", ",", ";", "\t"])
def test_what_stands_for_no_number_is_a_missing_return(tmp_path, none, delimiter):
    """Microsoft's C library writes 1.#QNAN: read up to the number sign it was the number 1."""
    text = "x y z intensity\n".replace(" ", delimiter) + rows(delimiter)
    lost = delimiter.join(["0.1", none, "0.3", "5.0"]) + "\n"
    scan = read(tmp_path, text + lost + rows(delimiter))
    assert scan.points_m.tolist() == POINTS.tolist() * 2
    assert (scan.invalid_points, scan.intensity.tolist()) == (1, SHADES * 2)
    first = read(tmp_path, rows(delimiter).replace("\n", "\n" + lost, 1))
    assert first.points_m.tolist() == POINTS.tolist()
    assert first.invalid_points == 1


@pytest.mark.parametrize("none", SIGNS)
def test_no_format_of_text_takes_them_for_numbers(tmp_path, none):
    body = f"1 2 3\n4 {none} 6\n7 8 9\n"
    fields = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex 3\n{fields}end_header\n"
    pcd = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n"
        "POINTS 3\nDATA ascii\n"
    )
    frame = "3\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    raster = frame + body.replace("\n", " 0.5\n")
    files = {"a.ply": head + body, "a.pcd": pcd + body, "a.pts": "3\n" + body, "a.ptx": raster}
    for name, text in files.items():
        scan = read(tmp_path, text, name)
        assert scan.points_m.tolist() == [[1, 2, 3], [7, 8, 9]]
        assert scan.invalid_points == 1


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_an_empty_cell_is_a_missing_return(tmp_path, delimiter):
    text = "x y z intensity\n".replace(" ", delimiter) + rows(delimiter)
    for cells in (["", "1", "2", "3"], ["1", "", "2", "3"], ["1", "2", "", "3"], [""] * 4):
        scan = read(tmp_path, text + delimiter.join(cells) + "\n")
        assert (len(scan.points_m), scan.invalid_points) == (6, 1)
    shade = read(tmp_path, text + delimiter.join(["1", "2", "3", ""]) + "\n")
    assert (len(shade.points_m), shade.invalid_points) == (7, 0)
    assert np.isnan(shade.intensity[-1])


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_rows_without_any_value_may_come_first(tmp_path, delimiter):
    """As of a raster whose first beams met nothing."""
    gap = delimiter.join([""] * 4 if delimiter != "\t" else ["N/A"] * 4) + "\n"
    for head in ("", "X Y Z I\n".replace(" ", delimiter)):
        scan = read(tmp_path, head + gap + gap + rows(delimiter))
        assert (scan.points_m.tolist(), scan.invalid_points) == (POINTS.tolist(), 2)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("head", ["", "x{0}y{0}z\n", "x{0}y{0}z{0}\n"])
def test_a_delimiter_may_end_each_row(tmp_path, delimiter, head):
    text = head.format(delimiter) + rows(delimiter, shades=False, behind=delimiter)
    assert read(tmp_path, text).points_m.tolist() == POINTS.tolist()


def test_a_row_that_is_cut_at_a_delimiter_is_no_missing_return(tmp_path):
    refuse(tmp_path, rows(",") + "1.25,2.25,", "ends in the middle of a number")
    refuse(tmp_path, "x,y,z\n1.25,2.25,", "ends in the middle of a number")


HEADS = {
    "X [m] Y [m] Z [m] Intensity": ";",
    "x(m) y(m) z(m) i": ",",
    "X_m Y_m Z_m Intensity": ",",
    "x/m y/m z/m intensity": ";",
    "Points:0 Points:1 Points:2 Intensity": ",",
    '"Points_0" "Points_1" "Points_2" "Intensity"': ",",
    "Easting Northing Elevation Intensity": ",",
    "east north up reflectance": "\t",
    "pos_x pos_y pos_z i": ";",
    "X-coordinate Y-coordinate Z-coordinate I": ";",
    "'x' 'y' 'z' 'i'": " ",
}


@pytest.mark.parametrize("head", HEADS)
def test_columns_are_known_by_what_exporters_call_them(tmp_path, head):
    """In another order too: by their names, not by their places."""
    mark = HEADS[head]
    names = head.split(" ") if "[" not in head else head.replace(" [", "_[").split(" ")
    assert len(names) == 4
    for order in ((0, 1, 2, 3), (3, 2, 0, 1)):
        table = np.column_stack([POINTS, SHADES])[:, order]
        top = mark.join(names[k].replace("_[", " [") for k in order)
        body = "".join(mark.join(f"{x:.4f}" for x in row) + "\n" for row in table)
        scan = read(tmp_path, f"{top}\n{body}")
        assert scan.points_m.tolist() == POINTS.tolist()
        assert scan.intensity.tolist() == SHADES


@pytest.mark.parametrize(
    ("head", "says"),
    [
        ("X [mm];Y [mm];Z [mm]", "states lengths in mm, but they would be taken as m: give --le"),
        ("x(mm);y(mm);z(mm)", "in mm"),
        ("X_mm;Y_mm;Z_mm", "in mm"),
        ("X_in;Y_in;Z_in", "states lengths in in, but .* --length-unit in, or length_unit = "),
        ("X_ft;Y_ft;Z_ft", "states lengths in ft, but .* --length-unit ft, or length_unit = "),
        ("x [µm];y [µm];z [µm]", "states lengths in µm, but .*: export them in m, mm, in, cm, ft"),
        ("x [px];y [px];z [px]", "states lengths in px"),
        ("x;y;z\nmm;mm;mm", "in mm"),
        ("x;y;z\n[mm];[mm];[mm]", "in mm"),
        ("X [m];Y [m];Z [mm]", "the columns of x, y and z have the units m, mm"),
    ],
)
def test_a_unit_in_the_header_that_contradicts_the_given_one_is_an_error(tmp_path, head, says):
    refuse(tmp_path, f"{head}\n{rows(';', shades=False)}", says)


@pytest.mark.parametrize(
    "line",
    [
        *("# Units: mm", "Unit: mm", "// Units = [mm]", "Units;mm", "# Length unit: millimetres"),
        *("# units in mm", "# Coordinate units are mm", "# Units: mm\n# Date: 2026-11-20"),
    ],
)
def test_a_unit_in_a_line_above_the_rows_must_be_the_given_one(tmp_path, line):
    for head in ("", "x;y;z;i\n"):
        text = f"{line}\n{head}{rows(';')}"
        refuse(tmp_path, text, "states lengths in mm, but they would be taken as m")
        assert read(tmp_path, text, unit="mm").points_m.tolist() == (POINTS / 1e3).tolist()
    assert read(tmp_path, f"{line}\nX [m];Y [m];Z [m];I\n{rows(';')}").invalid_points == 0


def test_a_unit_above_heights_must_be_the_given_one_where_their_pitch_is_an_option(tmp_path):
    text = f"Unit,mm\n{rows(',')}"
    refuse(tmp_path, text, "states lengths in mm, but they would be taken", pitch=(0.1, 0.1))
    scan = read(tmp_path, text, unit="mm", pitch=(0.1, 0.1))
    assert scan.points_m[:3, 2].tolist() == (POINTS[0] / 1e3).tolist()


def test_lines_that_state_no_unit_or_several(tmp_path):
    for line in ("# Units: default", "# unit: in the frame of the bay", "# Intensity unit: mm"):
        assert len(read(tmp_path, f"{line}\n{rows()}").points_m) == 6
    refuse(tmp_path, f"# Unit: mm\n# Unit: in\n{rows()}", "state the units in, mm: state one")


@pytest.mark.parametrize("unit", LENGTH_UNITS)
@pytest.mark.parametrize("head", ["X [{0}];Y [{0}];Z [{0}];I [-]", "x;y;z;i\n{0};{0};{0};-"])
def test_a_unit_in_the_header_that_agrees_is_used(tmp_path, unit, head):
    scan = read(tmp_path, head.format(unit) + "\n" + rows(";"), unit=unit)
    plain = read(tmp_path, rows(";"), unit=unit)
    assert scan.points_m.tobytes() == plain.points_m.tobytes()
    assert scan.intensity.tolist() == SHADES


@pytest.mark.parametrize("sign", ["# ", "#", "//", "// "])
@pytest.mark.parametrize("count", ["", "6\n"])
def test_names_in_a_comment_are_names(tmp_path, sign, count):
    scan = read(tmp_path, f"{sign}Y X Z Intensity\n{count}{rows()}")
    assert scan.points_m.tolist() == POINTS[:, [1, 0, 2]].tolist()
    assert scan.intensity.tolist() == SHADES


@pytest.mark.parametrize("sign", ["", "# ", "//"])
@pytest.mark.parametrize(
    "head",
    [
        *("Z [{0}], Y [{0}], X [{0}]", "Z [{0}] Y [{0}] X [{0}]", "Z ({0}); Y ({0}); X ({0})"),
        *('"Z [{0}]" "Y [{0}]" "X [{0}]"', "Columns: Z_{0} Y_{0} X_{0}", "Z_{0}, Y_{0}, X_{0}"),
        *("Fields = Z [{0}], Y [{0}], X [{0}]", "Column order: Z_{0}, Y_{0}, X_{0}"),
    ],
)
@pytest.mark.parametrize("mark", [" ", ";", ","])
def test_names_are_found_where_they_are_separated_otherwise_than_the_rows(
    tmp_path, mark, head, sign
):
    """None is passed over, which would take z for x and millimetres for metres."""
    text = f"{sign}{head.format('mm')}\n{rows(mark, shades=False)}"
    scan = read(tmp_path, text, unit="mm")
    assert scan.points_m.tolist() == (POINTS[:, ::-1] / 1e3).tolist()
    refuse(tmp_path, text, "states lengths in mm, but they would be taken as m")


@pytest.mark.parametrize("words", ["made by hand of y x z", "points: x y z", "1 2 3 4", ""])
def test_other_comments_name_nothing(tmp_path, words):
    scan = read(tmp_path, f"# {words}\n{rows()}")
    assert scan.points_m.tolist() == POINTS.tolist()
    assert scan.intensity.tolist() == SHADES


def test_names_in_a_comment_that_do_not_fit_are_refused(tmp_path):
    refuse(tmp_path, "# Y X Z\n" + rows(), "3 columns are named in 'Y X Z', but line 2 has 4 col")
    assert len(read(tmp_path, "# X Y Z\n" + rows()).points_m) == 6


PREAMBLES = [
    "Point cloud export\n",
    "Exported by Studio 4.2\nDate: 2026-11-20 10:00:00\n\n",
    "; settings\nResolution;0.5;;\nNumber of points;6;;\n",
    "[Header]\nOperator=J. Smith\nOffset=1.0 2.0 3.0\n[Data]\n",
    "----------\nScan 12 of wheel\n==========\n",
    "Größe der Wolke\n".encode("cp1252"),
]


@pytest.mark.parametrize("preamble", PREAMBLES)
@pytest.mark.parametrize("head", ["", "x;y;z;i\n"])
@pytest.mark.parametrize("footer", ["", "End of file\n", "\nTotal: 6 points\n", "[End]\n---\n"])
def test_prose_around_the_rows_is_passed_over(tmp_path, preamble, head, footer):
    above = preamble if isinstance(preamble, bytes) else preamble.encode()
    scan = read(tmp_path, above + (head + rows(";") + footer).encode())
    assert scan.points_m.tolist() == POINTS.tolist()
    assert (scan.invalid_points, scan.intensity.tolist()) == (0, SHADES)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("1.0 2.0 3.x 4.0\n" + rows(), "line 1 holds '3.x'"),
        ("x.0 2.0 3.0 4.0\n" + rows(), "line 2 begins with no name, as the first row does"),
        ("kxq 2.0 3.0\n" + rows(shades=False), "line 1 is neither a row of numbers nor a heading"),
        ("abc def 3.0 4.0\n" + rows(), "line 1 is neither a row of numbers nor a heading"),
        ("\x1ascan\n" + rows(), "line 1 is neither a row of numbers nor a heading"),
        ("1.0 2.0\n" + rows(), "line 1 has 2 columns"),
        (rows() + "1.0 2.0 3.x 4.0\n", "line 7 holds '3.x'"),
        (rows() + "abc 2.0 3.0 4.0\n", "line 7 holds 'abc'"),
        (rows() + "1.0 2.0\n", "line 7 has 2 columns instead of 4"),
        (rows() + "End of file\n" + rows(), "line 7 is no row, but rows follow it: 'End of file'"),
        (rows() + "End of file\n" + "# comment\n" * 90_000 + rows(), "line 7 is no row"),
    ],
)
def test_a_damaged_row_is_no_prose(tmp_path, text, says):
    refuse(tmp_path, text, says)


@pytest.mark.parametrize("delimiter", [" ", ",", ";", "\t"])
def test_a_column_of_names_is_passed_over(tmp_path, delimiter):
    label = "P{}" + delimiter
    plain = read(tmp_path, rows(delimiter, before=label))
    named = read(tmp_path, f"Name,X,Y,Z,I\n{rows(delimiter, before=label)}")
    last = read(tmp_path, f"X Y Z I Name\n{rows(delimiter, behind=delimiter + 'P {}'.strip())}") \
        if delimiter != " " else plain  # fmt: skip
    for scan in (plain, named, last):
        assert scan.points_m.tolist() == POINTS.tolist()
        assert scan.intensity.tolist() == SHADES


def test_names_that_turn_into_numbers_are_refused(tmp_path):
    text = rows(before="P{} ") + "7 1.0 2.0 3.0 4.0\n"
    refuse(tmp_path, text, "line 7 begins with no name, as the first row does")


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("name", ["rr.txt", "rr.csv", "rr.asc", "rr.pts"])
def test_utf_16_is_text(tmp_path, encoding, name):
    mark = codecs.BOM_UTF16_LE if encoding.endswith("le") else codecs.BOM_UTF16_BE
    data = mark + rows().replace("\n", "\r\n").encode(encoding)
    scan = read(tmp_path, data, name)
    assert scan.points_m.tolist() == POINTS.tolist()
    assert scan.intensity.tolist() == SHADES
    refuse(tmp_path, data[:-1], "begins as UTF-16 text, but is not", name)


def test_quoted_numbers_are_numbers(tmp_path):
    quoted = "".join(
        ",".join(f'"{cell}"' for cell in line.split(",")) + "\n" for line in rows(",").splitlines()
    )
    assert read(tmp_path, quoted).points_m.tolist() == POINTS.tolist()
    comma = quoted.replace('"', "~").replace(",", ";").replace(".", ",").replace("~", '"')
    assert read(tmp_path, comma).points_m.tolist() == POINTS.tolist()
    german = quoted.replace(".", ",")
    assert read(tmp_path, german).points_m.tolist() == POINTS.tolist()


GRID = "".join(f"{k // 4} {k % 4} {0.31 * k:.3f} {1.7 - k * 0.2:.3f} 2.{k}5 7\n" for k in range(12))
INDEX = "".join(f"{k + 1} {0.31 * k:.3f} {1.7 - k * 0.2:.3f} 2.{k}5\n" for k in range(12))


@pytest.mark.parametrize(
    ("text", "columns", "says"),
    [
        (GRID, "row,col,x,y,z,i", "its first two columns are whole numbers"),
        (GRID.replace(" ", ","), "row,col,x,y,z,-", "give --columns row,col,x,y,z,- or, if"),
        (INDEX, "-,x,y,z", "its first column counts the rows"),
        (INDEX.replace("\n7 ", "\n17 ").replace("\n8 ", "\n18 "), "id,x,y,z", "."),
        (INDEX.replace("\n", " 9\n"), "-,x,y,z,i", "give --columns -,x,y,z,- or, if they are c"),
    ],
)  # fmt: skip
def test_row_and_column_and_index_are_not_coordinates(tmp_path, text, columns, says):
    if says != ".":
        refuse(tmp_path, text, says)
    table = np.array(
        [[float(x) for x in row.replace(",", " ").split()] for row in text.split("\n") if row]
    )
    names = columns.split(",")
    scan = read(tmp_path, text, columns=tuple(names))
    at = [names.index(axis) for axis in "xyz"]
    assert scan.points_m.tolist() == table[:, at].tolist()
    assert (scan.intensity is None) == ("i" not in names)


@pytest.mark.parametrize(
    "text",
    [
        "".join(f"{k % 5} {k // 5} {0.1 * k:.2f}\n" for k in range(20)),  # a raster in mm
        "".join(f"{k % 5} {k // 5} {0.1 * k:.2f} {k}.5\n" for k in range(20)),
        "".join(f"{k * 7 % 11} {k % 3} {0.1 * k:.2f} 200 100 {k}\n" for k in range(20)),  # colours
        "".join(f"{k} {k} {k} 25\n" for k in range(9)),
    ],
)
def test_whole_coordinates_are_coordinates(tmp_path, text):
    first = [float(cell) for cell in text.split("\n")[0].split()]
    assert read(tmp_path, text).points_m[0].tolist() == first[:3]


def test_named_columns_replace_those_of_the_file(tmp_path):
    """And a text without a header need not be in the order x y z."""
    expected = POINTS[:, [2, 0, 1]].tolist()
    assert read(tmp_path, rows(), columns=("y", "z", "x", "-")).points_m.tolist() == expected
    text = "a;b;c;d\n" + rows(";")
    assert read(tmp_path, text, columns=("y", "z", "x", "-")).points_m.tolist() == expected
    names = ("-", "x", "y", "z")
    strings = rows(before="12.03.2026 ", shades=False)
    assert read(tmp_path, strings, columns=names).points_m.tolist() == POINTS.tolist()
    refuse(tmp_path, rows(), "line 1 has 4 columns, --columns names 3", columns=("x", "y", "z"))
    four = ("x", "y", "z", "i")
    refuse(tmp_path, "abc 2.0 3.x 4.0\n" + rows(), "line 1 is neither a row of", columns=four)


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "a.las", "a.ptx", "a.stl", "a.obj", "a.e57"])
def test_options_are_for_files_that_need_them(tmp_path, name):
    refuse(tmp_path, b"1", r"--columns \(or columns in capture.toml\) is not for \.", name,
           columns=("x", "y", "z"))  # fmt: skip
    refuse(tmp_path, b"1", r"--pitch \(or pitch in capture.toml\) is not for \.", name,
           pitch=(1.0, 1.0))  # fmt: skip


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"columns": ("x", "y")}, "z is named 0 times"),
        ({"columns": ("x", "y", "z", "x")}, "x is named 2 times"),
        ({"columns": ("x", "y", "z", "shade")}, "the column 'shade' is unknown: name x, y, z, i"),
        ({"columns": ("x", "y", "z", "i", "intensity")}, "the intensity is named twice"),
        ({"pitch": (0.0, 1.0)}, "two numbers other than 0"),
        ({"pitch": (float("nan"), 1.0)}, "two numbers other than 0"),
        ({"columns": ("x", "y", "z"), "pitch": (1.0, 1.0)}, "give one"),
    ],
)
def test_options_that_cannot_be_are_refused(given, says):
    with pytest.raises(ValueError, match=says):
        ReadOptions(**given)


PTS = {
    "header": "X Y Z Intensity\n",
    "comment": "# made by hand\n",
    "count and names": "6\n//X Y Z Intensity\n",
    "count below names": "//X Y Z Intensity\n6\n",
    "byte order mark": "\ufeff6\n",
}


@pytest.mark.parametrize("head", PTS)
@pytest.mark.parametrize("delimiter", [" ", ",", ", ", ";"])
def test_pts_with_a_header_comments_and_commas(tmp_path, head, delimiter):
    scan = read(tmp_path, PTS[head] + rows(delimiter) + "# end\n", "rr.pts")
    assert scan.points_m.tolist() == POINTS.tolist()
    assert scan.intensity.tolist() == SHADES
    if "6" in PTS[head]:
        cut = "".join(rows(delimiter).splitlines(keepends=True)[:5])
        refuse(tmp_path, PTS[head] + cut, "declares 6 points, the file holds 5", "rr.pts")
    seven = "".join(f"{line} 1 2 3\n" for line in rows().splitlines())
    scan = read(tmp_path, f"# a comment\n6\n{seven}", "rr.pts")
    assert scan.intensity.tolist() == SHADES
    assert read(tmp_path, rows(), "rr.pts", columns=("z", "x", "y", "-")).intensity is None


@pytest.mark.parametrize(("columns", "shaded"), [(3, False), (4, True), (7, True), (10, True)])
def test_the_fourth_of_four_seven_or_ten_columns_of_pts_is_the_intensity(tmp_path, columns, shaded):
    behind = " 1" * (columns - 3 - shaded)
    scan = read(tmp_path, f"6\n{rows(shades=shaded, behind=behind)}", "rr.pts")
    assert (scan.intensity is not None) == shaded
    if shaded:
        np.testing.assert_array_equal(scan.intensity, SHADES)
