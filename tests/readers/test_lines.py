"""Lines and tables of text: the same whatever the size of the pieces they are read in."""

import io
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.sources import opened
from wheelplane.errors import InputError
from wheelplane.readers.faults import fault, too_long, too_short
from wheelplane.readers.parsing import ascii as text_tables
from wheelplane.readers.parsing import lines as text_lines
from wheelplane.readers.parsing.ascii import (
    Cells,
    cells_of,
    content,
    has_decimal_comma,
    table_blocks,
)
from wheelplane.readers.parsing.lines import (
    Lines,
    RowLengths,
    count_lines,
    count_of_lines,
    is_number,
    pass_blank_lines,
    pass_lines,
    rows_of,
)

SIZES = [1, 7, 64, 1 << 19]
ROWS = np.round(np.random.default_rng(3).normal(0.0, 50.0, (41, 4)), 3)
BODY = "".join(" ".join(f"{x:.3f}" for x in row) + "\n" for row in ROWS)


def text(body):
    return io.StringIO(body)


@given(st.text("ab \n", max_size=60), st.integers(1, 30))
def test_pieces_are_whole_lines_and_join_to_the_text(body, size):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_lines, "_PIECE", size)
        reader = Lines(text(body))
        pieces = list(iter(reader.piece, ""))
    assert "".join(pieces) == body
    assert all(piece.endswith("\n") for piece in pieces[:-1])
    assert sum(map(count_of_lines, pieces)) == len(body.split("\n")) - body.endswith("\n") * 1 - (
        body == ""
    )
    assert sum(map(rows_of, pieces)) == sum(bool(line.strip()) for line in body.split("\n"))


@given(st.lists(st.sampled_from(["", " \t", "\r", " 1 2", "x"]), max_size=20), st.integers(1, 9))
def test_blank_lines_are_passed_up_to_the_first_other_one(body, size):
    stream = io.BufferedReader(io.BytesIO("".join(f"{line}\n" for line in body).encode()))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_lines, "_PIECE", size)
        passed = pass_blank_lines(stream)
    blank = [not line.strip() for line in body]
    assert passed == (blank.index(False) if False in blank else len(body))
    assert stream.read() == "".join(f"{line}\n" for line in body[passed:]).encode()


@given(st.lists(st.sampled_from(["", " ", "1 2", "x"]), max_size=20), st.data())
def test_skipping_lines_or_rows_is_dropping_them_from_the_list(body, data):
    joined = "".join(line + "\n" for line in body)
    count = data.draw(st.integers(0, len(body)))
    reader = Lines(text(joined))
    reader.skip(count)
    assert "".join(iter(reader.piece, "")) == "".join(line + "\n" for line in body[count:])
    rows = data.draw(st.integers(0, sum(bool(line.strip()) for line in body)))
    reader = Lines(text(joined))
    skipped = reader.skip_rows(rows)
    assert sum(bool(line.strip()) for line in body[:skipped]) == rows
    assert reader.rows_left() == sum(bool(line.strip()) for line in body[skipped:])


def test_an_end_that_was_set_hides_the_rest_and_can_be_lifted():
    reader = Lines(text("a\nb\nc\nd\n"))
    reader.end_after(2)
    assert "".join(iter(reader.piece, "")) == "a\nb\n"
    reader.end_after(None)
    assert "".join(iter(reader.piece, "")) == "c\nd\n"


@given(st.text("0123456789.eE+-naifINFtyx ", max_size=9))
def test_a_number_is_what_python_reads_as_one(word):
    try:
        float(word)
    except ValueError:
        expected = False
    else:
        expected = word == word.strip()
    assert is_number(word) == expected


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b"\r"])
@pytest.mark.parametrize("size", SIZES)
def test_lines_are_counted_by_any_line_end(tmp_path, monkeypatch, end, size):
    monkeypatch.setattr(text_lines, "_PIECE", size)
    data = BODY.encode().replace(b"\n", end)
    with opened(tmp_path, data) as source:
        source.stream.seek(5)
        found = count_lines(source)
        assert source.stream.tell() == 5
    # A piece that ends between CR and LF counts both: the number is an upper bound.
    split = end == b"\r\n" and size < len(data)
    assert len(ROWS) <= found <= len(ROWS) * (2 if split else 1)
    with opened(tmp_path, BODY.encode()) as source:
        assert pass_lines(source.stream, 30) == 30
        assert pass_lines(source.stream, 30) == len(ROWS) - 30


def test_a_table_cut_within_a_number_is_refused_and_one_without_its_last_line_end_is_not(tmp_path):
    data = BODY.encode().rstrip(b"\n")
    with opened(tmp_path, data) as source:
        assert count_lines(source) == len(ROWS)
    for cut in (1, 2):
        with opened(tmp_path, data[:-cut]) as source, pytest.raises(InputError, match="middle of"):
            count_lines(source)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(("delimiter", "comma"), [(None, "."), (",", "."), (";", ","), (";", ".")])
def test_a_table_is_that_of_numpy_whatever_separates_and_however_it_is_read(
    tmp_path, monkeypatch, size, delimiter, comma
):
    monkeypatch.setattr(text_lines, "_PIECE", size)
    body = BODY.replace(".", comma).replace(" ", delimiter or " ")
    with opened(tmp_path, b"") as source:
        found = list(table_blocks(Lines(text(body)), 4, delimiter, source, 1))
        limited = list(table_blocks(Lines(text(body)), 4, delimiter, source, 1, limit=17))
    assert np.vstack(found).tobytes() == np.loadtxt(text(BODY)).tobytes()
    assert np.vstack(limited).tobytes() == ROWS[:17].tobytes()


@pytest.mark.parametrize("size", [1, 64, 1 << 19])
@pytest.mark.parametrize("bad", ["1 2 3", "1 2 3 4 5", "1 2 x 4", "1 2 3 --4"])
def test_the_first_wrong_line_is_named_by_its_number(tmp_path, monkeypatch, size, bad):
    monkeypatch.setattr(text_lines, "_PIECE", size)
    body = BODY.splitlines(keepends=True)
    for at in (0, 20, len(body) - 1):
        broken = "// a comment\n\n" + "".join([*body[:at], bad + "\n", *body[at + 1 :]])
        with opened(tmp_path, b"") as source, pytest.raises(InputError) as caught:
            list(table_blocks(Lines(text(broken)), 4, None, source, 11))
        assert f"line {11 + 2 + at} " in str(caught.value)


def test_a_comma_between_digits_is_decimal_where_something_else_separates():
    assert has_decimal_comma("1,5;2;-3,25e-3", ";")
    assert has_decimal_comma("1,5 2,5 3", None)
    assert not has_decimal_comma("1,5,2,5", ",")
    assert not has_decimal_comma("1.5;2.5", ";")
    assert not has_decimal_comma("1,5,2 3", None)
    assert [content(line) for line in ("1 2 # x", " 1 2 // x", "#", " ")] == ["1 2", "1 2", "", ""]


def test_messages_name_the_file_the_fact_and_what_to_do(tmp_path):
    with opened(tmp_path, b"") as source:
        found = [fault(source, "it is odd"), too_short(source, 5, 3), too_long(source, 5, "7 more")]
    for error in found:
        name, fact, action = str(error).split(": ", 2)
        assert name == "rr.dat"
        assert fact
        assert action
    assert "5" in str(found[1])
    assert "3" in str(found[1])


def test_a_decimal_comma_needs_a_second_field_and_one_comma_a_number():
    assert has_decimal_comma("1,5 2,5", None)
    assert has_decimal_comma("1,5E3;INF;2,5e-3", ";")
    assert not has_decimal_comma("1,5;\u0661,\u0665", ";")  # digits that float() would take
    assert not has_decimal_comma("1,5", None)
    assert not has_decimal_comma("1,5", ";")
    assert not has_decimal_comma("1,5,2 3,5", None)


def test_cells_are_bare_and_tabs_that_separate_are_kept():
    assert content(" 1\t\t\n", "\t") == "1\t\t"
    assert content("\t1;\t\n", ";") == "1;"
    assert cells_of('1, "2,5" , 3', ",") == ["1", "2,5", "3"]
    assert cells_of("1\t\t", "\t") == ["1", "", ""]


def tables_of(folder, body, columns, delimiter=",", cells=text_tables.NUMBERS):
    with opened(folder, b"") as source:
        tables = table_blocks(Lines(text(body)), columns, delimiter, source, 1, cells=cells)
        return np.vstack([np.empty((0, columns)), *tables])


@pytest.mark.parametrize("size", SIZES)
def test_comments_and_blank_lines_are_no_rows_in_pieces_of_any_size(tmp_path, monkeypatch, size):
    monkeypatch.setattr(text_lines, "_PIECE", size)
    body = "".join(f"{line}\n# {line}\n\n // x\n" for line in BODY.splitlines())
    assert tables_of(tmp_path, body, 4, None).tobytes() == ROWS.tobytes()


@pytest.mark.parametrize("slow", ["", "// a comment, which numpy does not take for one\n"])
def test_a_last_delimiter_is_no_cell_and_any_other_is(tmp_path, slow):
    """Both parsers: numpy's, and the one that goes line by line."""
    assert tables_of(tmp_path, slow + "1,2,3,\n4,5,6,\n", 3).tolist() == [[1, 2, 3], [4, 5, 6]]
    assert np.isnan(tables_of(tmp_path, slow + "1,2,\n4,5,6\n", 3)[0, 2])
    for wrong in ("1,,3,4", "1,2,,4", "1,2,3,4", "1,2,3,,", "1,"):
        for body in (f"{wrong}\n", f"1,2,3\n{wrong}\n"):
            with pytest.raises(InputError, match=r"columns instead of 3"):
                tables_of(tmp_path, slow + body, 3)


@pytest.mark.parametrize("columns", [2, 4])
def test_rows_that_all_have_another_width_are_refused(tmp_path, columns):
    with pytest.raises(InputError, match=f"line 1 has 3 columns instead of {columns}"):
        tables_of(tmp_path, "1,2,3\n4,5,6\n", columns)


@pytest.mark.parametrize("slow", ["", "// a comment\n"])
def test_what_stands_for_no_number_is_nan_in_both_parsers(tmp_path, slow):
    found = tables_of(tmp_path, slow + "nan,2,3\nN/A,5,6\n,8,9\ninf,1,2\n", 3)
    assert np.isnan(found[:3, 0]).all()
    assert np.isinf(found[3, 0])
    assert found[:, 1:].tolist() == [[2, 3], [5, 6], [8, 9], [1, 2]]


def test_a_footer_is_as_long_as_it_may_be(tmp_path, monkeypatch):
    monkeypatch.setattr(text_tables, "_LONGEST_FOOTER", 3)
    body, footer = "1,2,3\n" * 5, "End of export\n"
    cells = Cells(footer=True)
    assert len(tables_of(tmp_path, body + 3 * footer, 3, cells=cells)) == 5
    with pytest.raises(InputError, match="line 6 is no row"):
        tables_of(tmp_path, body + 4 * footer, 3, cells=cells)


def test_text_below_a_table_is_no_part_of_it_unless_it_may_have_a_footer(tmp_path):
    with pytest.raises(InputError, match="line 3 has 1 columns instead of 3"):
        tables_of(tmp_path, "1,2,3\n4,5,6\nEnd of export\n", 3)


def test_pieces_end_where_the_end_was_set_whatever_is_asked_for():
    reader = Lines(text("a\nb\nc\nd\n"))
    reader.end_after(2)
    assert reader.piece(5) == "a\nb\n"
    assert reader.piece(5) == ""
    reader.end_after(None)
    assert reader.piece(1) == "c\n"


@given(st.lists(st.text("ab\n\r", max_size=9), max_size=9))
def test_a_line_is_too_long_where_its_piece_ends(pieces):
    """The open end of all that was given, measured anew after each piece."""
    open_ends = [re.split("[\n\r]", "".join(pieces[:n]))[-1] for n in range(1, len(pieces) + 1)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_lines, "_LONGEST_LINE", 5)
        rows = RowLengths("rr.dat")
        for piece, end in zip(pieces, open_ends, strict=True):
            if len(end) > 5:
                with pytest.raises(InputError, match=r"rr\.dat: a line is longer than 5 char"):
                    rows.check(piece.encode())
                break
            rows.check(piece.encode())


CUT = ["1.123", "2.456", "3.789", "4.012", "5.345", "6.678"]
ENDS = {
    "1,2,3\n4,5,": True,
    "1,2,\n4,5,": False,
    "1,2,3,\n4,5,": True,
    "1,2,3,\n1,2,3,\n4,5,": True,
    "1,2,3,\n4,5,6,\n7,8,9,": False,
    "1,2,": True,
    "1": True,
    "\n".join([*CUT, "7.9"]): True,
    "\n".join([*CUT, "7.901"]): False,
    "\n".join([*CUT, "7.9012"]): True,
    "\n".join([CUT[0], "2.45", *CUT[2:], "7.9"]): False,
    "\n".join([*CUT[:-1], "6.67", "7.9"]): False,
    "\n".join(["1.1", *CUT[1:], "7.9"]): True,  # the first may begin within a line
    "\n".join([*CUT[:3], "# 1.5", "", *CUT[3:], "7.9"]): True,
    "\n".join([*CUT, "Total: 6"]): False,
}


@pytest.mark.parametrize("body", ENDS)
@pytest.mark.parametrize("above", ["", "# made\n"])
def test_a_last_line_is_cut_where_it_is_shorter_than_those_above(tmp_path, body, above):
    with opened(tmp_path, (above + body).encode()) as source:
        if ENDS[body]:
            with pytest.raises(InputError, match="ends in the middle of a number"):
                count_lines(source)
        else:
            assert count_lines(source) == (above + body).count("\n") + 1
