"""PTX and PTS: several scans in a file, poses applied once, beams without a return, the raster."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.paths import FORMATS
from tests.support.scenes import rotation
from tests.support.sources import opened
from tests.support.sources import table as rows_of
from wheelplane.errors import InputError
from wheelplane.readers import read_scan
from wheelplane.readers.formats import pts as pts_format
from wheelplane.readers.formats import ptx as ptx_format
from wheelplane.readers.formats.pts import read_pts
from wheelplane.readers.formats.ptx import read_ptx

IDENTITY = np.eye(4)


def ptx(scans, end="\n"):
    """Scans (columns, rows, T_file_scan, table) as text; the 4x4 is written transposed."""
    out = []
    for columns, rows, T, table in scans:
        out += [
            str(columns),
            str(rows),
            *(words(row) for row in np.vstack([T[:3, 3], T[:3, :3].T])),
        ]
        out += [words(row) for row in T.T] + [words(row) for row in table]
    return (end.join(out) + end).encode()


def words(row):
    return " ".join(repr(float(x)) for x in row)


def read(folder, name, data, **options):
    path = folder / name
    path.write_bytes(data)
    return read_scan(path, name=name, **options)


def refuse(folder, name, data, pattern):
    with pytest.raises(InputError, match=pattern) as caught:
        read(folder, name, data)
    assert_one_line(caught.value, name)


def assert_one_line(error, name):
    assert str(error).startswith(f"{name}: ")
    assert len(str(error).splitlines()) == 1


def pose(seed, reach=1e7):
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(rng), rng.uniform(-reach, reach, 3)
    return T


def table(seed, count, reach=20.0):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-reach, reach, (count, 3)), rng.uniform(0, 1, count)])


def exactly(T, points):
    """R p + t in rational numbers, rounded once: an independent product."""
    exact = [[Fraction(float(x)) for x in row] for row in T]
    return np.array(
        [
            [
                float(sum(a * b for a, b in zip(row[:3], p, strict=True)) + row[3])
                for row in exact[:3]
            ]
            for p in ([Fraction(float(x)) for x in point] for point in points)
        ]
    )


@pytest.mark.parametrize("reach", [0.0, 5.0, 1e7])
@pytest.mark.parametrize("away", [20.0, 1e7])
def test_each_scan_is_posed_once_to_the_last_digit(tmp_path, reach, away):
    tables = [table(seed, 12, away) for seed in range(3)]
    poses = [pose(seed, reach) for seed in range(3)]
    scan = read(
        tmp_path, "rr.ptx", ptx([(4, 3, *both) for both in zip(poses, tables, strict=True)])
    )
    expected = np.vstack([exactly(T, t[:, :3]) for T, t in zip(poses, tables, strict=True)])
    # R (p - c): about 4 roundings of |p - c|; R c + t and the sum: one of the result each.
    bound = 8 * np.finfo(float).eps * away * 2 + 2 * np.spacing(np.abs(expected).max())
    assert np.abs(scan.points_m - expected).max() < bound
    twice = np.vstack(
        [exactly(T, exactly(T, t[:, :3])) for T, t in zip(poses, tables, strict=True)]
    )
    transposed = np.vstack(
        [t[:, :3] @ T[:3, :3] + T[:3, 3] for T, t in zip(poses, tables, strict=True)]
    )
    for wrong in (twice, transposed, np.vstack(tables)[:, :3]):
        assert np.abs(wrong - expected).max() > 1e3 * bound
    assert [(p.name, p.start, p.stop) for p in scan.parts] == [
        ("1", 0, 12),
        ("2", 12, 24),
        ("3", 24, 36),
    ]
    for part, T in zip(scan.parts, poses, strict=True):
        assert part.T_file_scan.tolist() == T.tolist()


def test_site_coordinates_that_a_pose_brings_home_keep_their_digits(tmp_path):
    """R p + t, both of 1e7 m, is a scan of 20 m: a plain product would round at 1e7 m."""
    rows, T = table(11, 12), pose(11)
    rows[:, :3] += 1e7
    T[:3, 3] = -T[:3, :3] @ np.full(3, 1e7)
    expected = exactly(T, rows[:, :3])
    # Of |p - c| < 40 m eight roundings; of R c + t at 1e7 m as many in extended precision.
    bound = 8 * (np.finfo(float).eps * 40 + np.finfo(np.longdouble).eps * 2e7)
    points_m = read(tmp_path, "rr.ptx", ptx([(4, 3, T, rows)])).points_m
    assert np.abs(points_m - expected).max() < bound
    plain = rows[:, :3] @ T[:3, :3].T + T[:3, 3]
    assert np.abs(plain - expected).max() > 10 * bound


def test_an_identity_pose_leaves_every_bit(tmp_path):
    rows = table(0, 6, 1e7)
    scan = read(tmp_path, "rr.ptx", ptx([(2, 3, IDENTITY, rows)]))
    assert scan.points_m.tobytes() == np.ascontiguousarray(rows[:, :3]).tobytes()


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 1e-3), ("in", 0.0254), ("cm", 1e-2), ("ft", 0.3048)]
)
def test_points_and_poses_are_in_the_same_unit(tmp_path, unit, metres):
    T, rows = pose(1, 3000.0), table(1, 6, 2000.0)
    scan = read(tmp_path, "rr.ptx", ptx([(2, 3, T, rows)]), length_unit=unit)
    expected = exactly(T, rows[:, :3]) * metres
    np.testing.assert_allclose(scan.points_m, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(scan.parts[0].T_file_scan[:3, 3], T[:3, 3] * metres, rtol=1e-15)
    assert scan.parts[0].T_file_scan[:3, :3].tolist() == T[:3, :3].tolist()


def test_beams_without_return_are_counted_and_the_raster_kept(tmp_path):
    columns, rows = 5, 4
    full = table(2, columns * rows)
    gone = np.random.default_rng(3).random(len(full)) < 0.4
    full[gone] = [0.0, 0.0, 0.0, 0.5]
    full[~gone, 1] = 0.0  # one coordinate of 0 is no invalid point
    scan = read(
        tmp_path, "rr.ptx", ptx([(columns, rows, pose(4), full), (1, 1, IDENTITY, full[~gone][:1])])
    )
    assert scan.invalid_points == gone.sum() > 0
    assert len(scan.points_m) == (~gone).sum() + 1
    column, row = np.divmod(np.arange(columns * rows), rows)  # written column by column
    assert scan.grid.dtype == np.int32
    assert scan.grid.tolist() == [*np.column_stack([row, column])[~gone].tolist(), [0, 0]]
    assert scan.intensity.tolist()[:-1] == full[~gone, 3].astype(np.float32).tolist()
    assert [(p.start, p.stop) for p in scan.parts] == [
        (0, (~gone).sum()),
        ((~gone).sum(), len(scan.points_m)),
    ]


def test_colours_blanks_at_the_end_and_crlf(tmp_path):
    rows = np.hstack([table(5, 4), np.full((4, 3), 200.0)])
    text = ptx([(2, 2, pose(5), rows)] * 2)
    scan = read(tmp_path, "rr.ptx", text)
    for other in (text.replace(b"\n", b"\r\n"), text + b"\n \n", text[:-1], text + b"\n" * 30):
        assert read(tmp_path, "rr.ptx", other).points_m.tobytes() == scan.points_m.tobytes()


def test_many_rows_are_posed_alike(tmp_path):
    """More rows than a piece of text holds, and points that are the same in each."""
    once = table(6, 1000)
    rows = np.tile(once, (12, 1))
    scan = read(tmp_path, "rr.ptx", ptx([(12, 1000, pose(6, 100.0), rows)]))
    expected = np.tile(exactly(pose(6, 100.0), once[:, :3]), (12, 1))
    assert np.abs(scan.points_m - expected).max() < 1e-13


def test_scans_of_the_pdal_sample_agree():
    """The file tells the same four points twice: scaled and shifted by its 4x4, and plainly."""
    scan = read_scan(FORMATS / "multiple-and-transform.ptx")
    assert scan.points_m.shape == (8, 3)
    np.testing.assert_allclose(scan.points_m[:4], scan.points_m[4:], rtol=0, atol=1e-9)
    assert np.abs(scan.points_m[:4] - scan.points_m[4:]).max() < 1.0 < scan.points_m[:, 2].min()
    assert scan.intensity[:4].tolist() == scan.intensity[4:].tolist()
    plain = read_scan(FORMATS / "no-color.ptx")
    assert plain.points_m[:4].tolist() == scan.points_m[4:].tolist()


GOOD = ptx([(2, 2, IDENTITY, table(7, 4)), (2, 2, IDENTITY, table(8, 4))])


@pytest.mark.parametrize(
    ("line", "text", "pattern"),
    [
        (1, b"two", "line 1 is not the number of columns"),
        (2, b"-2", "line 2 is not the number of rows"),
        (2, b"2 2", "line 2 is not the number of rows"),
        (1, b"1", "line 13 is not the number of columns"),
        (1, b"3", "line 17 is not the number of columns"),
        (1, b"1000000000", "line 1 is not the number of columns"),
        (2, b"100000000", "declares 2 x 100000000 points, the file holds 18 of them"),
        (4, b"1 0", "line 4 is not the scanner's position"),
        (7, b"1 0 0", "line 7 is not a row of its 4x4"),
        (7, b"1 0 0 x", "line 7 is not a row of its 4x4"),
        (7, b"-1 0 0 0", "the pose of its scan 1 is not a rotation"),
        (7, b"0 0 0 0", "the pose of its scan 1 is not a rotation"),
        (7, b"nan 0 0 0", "the pose of its scan 1 is not a rotation"),
        (7, b"1 0 0 0.5", "the pose of its scan 1 is not a rotation"),
        (11, b"1 2 3", "line 11 has 3 columns, not x y z intensity"),
        (12, b"1 2 3", "line 12 has 3 columns instead of 4"),
        (12, b"", "1 blank lines"),
        (12, b"1 2 3 z", "line 12 holds 'z'"),
        (25, b"1 2 \r3 4", "end with CR alone"),
        (20, b"0 0 0 7", "the pose of its scan 2 is not a rotation|line 20"),
    ],
)  # fmt: skip
def test_a_ptx_that_is_refused(tmp_path, line, text, pattern):
    lines = GOOD.split(b"\n")
    lines[line - 1] = text
    refuse(tmp_path, "rr.ptx", b"\n".join(lines), pattern)


def test_every_cut_of_a_ptx_is_refused_or_loses_no_point(tmp_path):
    whole = read(tmp_path, "rr.ptx", GOOD)
    between = 0
    for length in range(len(GOOD)):
        try:
            scan = read(tmp_path, "rr.ptx", GOOD[:length])
        except InputError as error:
            assert_one_line(error, "rr.ptx")
        else:
            count = len(scan.points_m)
            assert count in (4, 8)
            assert scan.points_m.tobytes() == whole.points_m[:count].tobytes()
            between += count == 4
    # At the end of the first scan the rest is missing without a trace.
    assert between <= len(GOOD.split(b"\n")[13].split()[-1]) + 2


@given(
    counts=st.lists(st.integers(1, 6), min_size=1, max_size=4),
    columns=st.sampled_from([3, 4, 6, 7]),
    end=st.sampled_from(["\n", "\r\n"]),
)
def test_pts_blocks_with_their_counts(tmp_path_factory, counts, columns, end):
    rows = table(9, sum(counts), 1e7).repeat(2, axis=1)[:, :columns]
    text, start = "", 0
    for count in counts:
        text += f"{count}{end}" + "".join(words(r) + end for r in rows[start : start + count])
        start += count
    scan = read(tmp_path_factory.mktemp("pts"), "rr.pts", text.encode())
    assert scan.points_m.tolist() == rows[:, :3].tolist()
    if columns in (4, 7):
        assert scan.intensity.tolist() == rows[:, 3].astype(np.float32).tolist()
    elif columns == 6:
        grey = rows[:, 3:] @ [0.2126, 0.7152, 0.0722]
        np.testing.assert_allclose(scan.intensity, grey, rtol=1e-6, atol=1e-6 * np.abs(rows).max())
    else:
        assert scan.intensity is None
    ends = np.cumsum(counts).tolist()
    expected = list(zip([0, *ends], ends, strict=False)) if len(counts) > 1 else []
    assert [(p.start, p.stop) for p in scan.parts] == expected
    assert all(part.T_file_scan is None for part in scan.parts)


def test_pts_without_count_and_leicas_intensities(tmp_path):
    text = b"1.5 2.5 3.5 -2048 1 2 3\n4 5 6 2047 1 2 3\n"
    for data in (text, b"\n" + text, b"2\n" + text, text + b"\n"):
        scan = read(tmp_path, "rr.pts", data)
        assert scan.points_m.tolist() == [[1.5, 2.5, 3.5], [4, 5, 6]]
        assert scan.intensity.tolist() == [-2048, 2047]
        assert scan.parts == ()
    sample = read_scan(FORMATS / "autzen.pts")
    assert len(sample.points_m) == 10
    assert tuple(sample.points_m[0]) == (636110.300003, 849345.050003, 512.139999)
    assert sample.intensity.tolist()[:3] == [-1613, -1998, 602]


@pytest.mark.parametrize(
    ("data", "pattern"),
    [
        ((FORMATS / "bunny_8.pts").read_bytes(), "declares 8 points, but rows from line 10 on"),
        (b"3\n1 2 3\n4 5 6\n", "declares 3 points, the file holds 2"),
        (b"1\n1 2 3\n4 5 6\n", "declares 1 points, but rows from line 3 on"),
        (b"2\n1 2 3\n2\n4 5 6\n7 8 9\n", "line 3 has 1 columns|rows from line 4"),
        (b"2\n1 2 3\n\n", "declares 2 points, the file holds 1"),
        (b"2\n1 2\n3 4\n", "a row has 2 columns, not x y z"),
        (b"1 2 3 4 5\n", "a row has 5 columns"),
        (b"1 2 3\n1 2 3 4\n", "line 2 has 4 columns"),
        (b"0\n", "0 points"),
        (b"0\n0\n", "0 points"),
        (b"\n\n", "0 points"),
        (b"1\n1 2 inf\n", "all its 1 points are invalid"),
        (b"100000000000000000\n1 2 3\n", "the file holds 1"),
        (b"1\n1\r2 3\n", "."),
    ],
)  # fmt: skip
def test_a_pts_that_is_refused(tmp_path, data, pattern):
    refuse(tmp_path, "rr.pts", data, pattern)


def pts_block(rows):
    return f"{len(rows)}\n".encode() + b"".join(
        " ".join(map(repr, row)).encode() + b"\n" for row in rows.tolist()
    )


@pytest.mark.parametrize("name", ["rr.pts", "rr.ptx"])
def test_files_put_one_after_the_other_are_their_scans_one_after_the_other(tmp_path, name):
    """Rows, part by part, are those of each file alone; only the numbers of the parts go on."""
    read = {"rr.pts": read_pts, "rr.ptx": read_ptx}[name]
    tables = [table(seed, 6) for seed in (1, 2, 3)]
    if name == "rr.pts":
        files = [pts_block(rows) for rows in tables]
    else:
        files = [ptx([(2, 3, pose(n), rows)]) for n, rows in enumerate(tables)]
    alone = []
    for data in files:
        with opened(tmp_path, data, name) as source:
            alone.append(rows_of(read(source)))
    with opened(tmp_path, b"".join(files), name) as source:
        cloud = read(source)
        blocks = [(block.part, len(block.xyz[0])) for block in cloud.blocks]
    with opened(tmp_path, b"".join(files), name) as source:
        joined = rows_of(read(source))
    assert joined.tobytes() == np.vstack(tables).tobytes() == np.vstack(alone).tobytes()
    assert [part.name for part in cloud.parts] == ["1", "2", "3"]
    assert [sum(n for part, n in blocks if part == k) for k in range(3)] == [6, 6, 6]
    if name == "rr.ptx":
        for n, part in enumerate(cloud.parts):
            assert part.T_file_scan.tolist() == pose(n).tolist()


@pytest.mark.parametrize("name", ["rr.pts", "rr.ptx"])
def test_a_file_cut_at_any_line_is_refused(tmp_path, name):
    rows = table(4, 6)
    data = pts_block(rows) * 2 if name == "rr.pts" else ptx([(2, 3, pose(1), rows)] * 2)
    read = {"rr.pts": read_pts, "rr.ptx": read_ptx}[name]
    lines = data.splitlines(keepends=True)
    whole = {len(lines), len(lines) // 2}  # the first scan alone is a file, too
    for end in sorted({*range(len(lines))} - whole):
        with opened(tmp_path, b"".join(lines[:end]), name) as source, pytest.raises(InputError):
            rows_of(read(source))


@pytest.mark.parametrize("above", ["", "\n", "\n \n\n"])
def test_rows_of_pts_without_a_count_are_counted(tmp_path, above):
    with opened(tmp_path, f"{above}1 2 3\n4 5 6\n".encode()) as source:
        cloud = read_pts(source)
        assert rows_of(cloud).tolist() == [[1, 2, 3], [4, 5, 6]]
        assert cloud.rows == 2


def test_the_most_scans_of_a_file_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(pts_format, "_MOST_BLOCKS", 2)
    monkeypatch.setattr(ptx_format, "_MOST_SCANS", 2)
    block, raster = b"1\n1 2 3\n", ptx([(1, 1, IDENTITY, [[1, 2, 3, 0.5]])])
    for name, piece, noun in (("a.pts", block, "blocks"), ("a.ptx", raster, "scans")):
        assert len(read(tmp_path, name, 2 * piece).points_m) == 2
        refuse(tmp_path, name, 3 * piece, f"more than 2 {noun}")


def test_a_raster_without_beams_holds_no_points(tmp_path):
    rows = [[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, 6.0, 0.5]]
    data = ptx([(0, 7, IDENTITY, []), (1, 2, IDENTITY, rows), (3, 0, IDENTITY, [])])
    scan = read(tmp_path, "a.ptx", data)
    assert scan.points_m.tolist() == [row[:3] for row in rows]
    assert [part.stop - part.start for part in scan.parts] == [0, 2, 0]


@pytest.mark.parametrize("columns", [4, 7, 10])
def test_rows_of_ptx_may_have_a_colour_and_a_normal(tmp_path, columns):
    rows = np.column_stack([table(1, 5), np.full((5, columns - 4), 7.0)])
    scan = read(tmp_path, "a.ptx", ptx([(1, 5, IDENTITY, rows)]))
    assert scan.points_m.tobytes() == rows[:, :3].tobytes()
    assert scan.intensity.tolist() == rows[:, 3].astype(np.float32).tolist()
    wider = ptx([(1, 5, IDENTITY, np.column_stack([rows, rows[:, :1]]))])
    refuse(tmp_path, "a.ptx", wider, f"line 11 has {columns + 1} columns, not x y z intensity")
