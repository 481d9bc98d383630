"""Small files that swell: one line, in little memory, whatever they claim to hold."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.fuzzing import swollen
from tests.fuzzing.samples import zipped
from wheelplane.errors import InputError
from wheelplane.readers import read_scan

pytestmark = pytest.mark.slow

MOST_MB, MOST_BYTES, MOST_S = 300, 3 << 30, 60.0  # the limit of address space spares the machine
FEW = b"nan nan nan\n" * 249_999 + b"1 2 3\n" + b"nan nan nan\n" * 249_999 + b"1 2 4\n"
FILES = {
    "a.tar.gz": (swollen.long_name, (4096,), "a name or attribute of 4294967296 bytes"),
    "a.tar": (swollen.digits, (128 << 10,), "a name or attribute of 131072 bytes"),
    "b.tar": (swollen.digits, (16 << 10,), "of 200 digits in a row"),
    "c.tar.gz": (swollen.many_members, (200_000,), "holds more than 10000 files"),
    "a.zip": (swollen.many_entries, (zipped({"a": b"1"}), 2_000_000), "its list of files takes"),
    "a.xyz.gz": (swollen.packed, (b"", b"1", 896, b"\n1 2 3\n"), "a line is longer than 1048576"),
    "a.ply.gz": (swollen.packed, (swollen.PLY, b"1", 896, b"\n"), "a line is longer than 1048576"),
    "b.xyz.gz": (swollen.packed, (b"", b"1", 240, b"\n1 2 3\n"), "a line is longer than 1048576"),
    "b.ply.gz": (swollen.packed, (swollen.PLY, b"1", 240, b"\n"), "a line is longer than 1048576"),
    "c.obj.gz": (swollen.packed, (b"v 1 2 3\n", b"1", 240, b"\n"), "a line is longer than"),
    "c.off.gz": (swollen.packed, (b"OFF\n", b"1", 240, b"\n"), "a line is longer than"),
    "c.stl.gz": (swollen.packed, (b"solid\n", b"1", 240, b"\n"), "a line is longer than"),
}  # fmt: skip
FACE = b"element face 1\nproperty list uchar int vertex_indices\n"
TABLES = {
    "a long key": (swollen.long_key(50_000), "a key has more than 32 parts"),
    "a long key of texts": (swollen.long_key(50_000).replace("a", '"a"'), "more than 32 parts"),
    "a long key of escapes": (swollen.long_key(50_000).replace("a", r'"\""'), "more than 32 parts"),
    "many run-outs": (swollen.many_runouts(20_000), "it is longer than 256 kB"),
    "many short tables": ("[[runout]]\n" * 20_000, "it holds 20000 tables"),
    "400 digits": (swollen.in_mm("9" * 400), "is too large: correct it"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_swollen_file_is_refused_in_little_memory(tmp_path, name):
    make, arguments, fact = FILES[name]
    (tmp_path / name).write_bytes(make(*arguments))
    code, line, peak_mb = ran(tmp_path, "inspect", name)
    assert (code, line.count("\n")) == (2, 1), line
    assert line.startswith(f"wheelplane: {name}: "), line
    assert fact in line
    assert peak_mb < MOST_MB


@pytest.mark.parametrize("name", TABLES)
def test_a_swollen_capture_toml_is_refused_before_it_is_parsed(tmp_path, name):
    text, fact = TABLES[name]
    (tmp_path / "capture.toml").write_text(text)
    code, line, peak_mb = ran(tmp_path, "measure", ".")
    assert (code, line.count("\n")) == (2, 1), line
    assert line.startswith("wheelplane: .: capture.toml: "), line
    assert fact in line
    assert peak_mb < MOST_MB


def test_many_run_outs_that_are_short_enough_are_read_at_once(tmp_path):
    """Of 60 bytes each; every one names a file that is missing."""
    runouts = ",".join(f'{{name="{k}",file="{k}",wheel="RR",angle_deg=1}}' for k in range(4500))
    (tmp_path / "capture.toml").write_text(f"runout = [{runouts}]\n{swollen.CAPTURE}")
    code, line, peak_mb = ran(tmp_path, "measure", ".")
    assert code == 2
    assert "is missing" in line
    assert peak_mb < MOST_MB


def test_a_few_points_among_many_rows_are_inspected(tmp_path):
    (tmp_path / "a.xyz").write_bytes(FEW)
    code, text, _ = ran(tmp_path, "inspect", "a.xyz")
    assert code == 0
    assert "2 (499998 invalid points besides)" in text


PCD = (
    b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\n"
)


@pytest.mark.parametrize(
    ("name", "data", "fact"),
    [
        (
            "a.pcd",
            PCD + b"\n" * 10_000 + b"DATA ascii\n1 2 3\n4 5 6\n7 8 9\n",
            "lines in its header",
        ),
        ("a.xyz", b"1 2 3\n1 2 4\n" + b"end of file\n" * 20_000, "line 3 is no row"),
    ],
)
def test_lines_without_points_are_bounded(tmp_path, name, data, fact):
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=fact):
        read_scan(path)


@pytest.mark.parametrize("between", ["\n", "# none\n", "// none\n"])
def test_lines_between_the_rows_of_a_ply_are_no_rows(tmp_path, between):
    """Also where there are many more of them than rows: they are passed in large pieces."""
    rows = [f"{k} 2 {k * k}\n" for k in range(1, 8)]
    head = swollen.PLY.replace(b"vertex 3", b"vertex 7").replace(b"end_", FACE + b"end_")
    text = (between * 9_000).join(rows) + "3 0 1 2\n"
    path = tmp_path / "a.ply"
    path.write_bytes(head + text.encode())
    assert read_scan(path).points_m.tolist() == [[k, 2, k * k] for k in range(1, 8)]


def test_a_row_behind_a_comment_sign_is_none_where_rows_begin_with_names(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("P1;1;2;3\n//P2;4;5;6\nP3;7;8;9\n")
    assert read_scan(path).points_m.tolist() == [[1, 2, 3], [7, 8, 9]]


# A small process between: the peak of a process counts that of the one that it was forked from.
STARTER = """
import os, resource, sys
child = os.fork()
if child == 0:
    resource.setrlimit(resource.RLIMIT_AS, ({bytes}, {bytes}))
    resource.setrlimit(resource.RLIMIT_CPU, ({seconds}, {seconds}))
    os.execv(sys.executable, [sys.executable, "-P", "-m", "wheelplane", *sys.argv[2:]])
_, status, used = os.wait4(child, 0)
with open(sys.argv[1], "w") as report:
    print(os.waitstatus_to_exitcode(status), used.ru_maxrss, file=report)
""".format(bytes=MOST_BYTES, seconds=int(MOST_S))


def ran(folder, *arguments):
    """Exit code, output and peak memory of a command, within limits; nothing is left behind."""
    scratch, report = folder / "scratch", folder.with_name(f"{folder.name}-report")
    scratch.mkdir()
    done = subprocess.run(
        [sys.executable, "-P", "-c", STARTER, report, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        env={**os.environ, "TMPDIR": str(scratch)},
        check=True,
    )
    code, peak_kb = map(int, report.read_text().split())
    assert list(scratch.iterdir()) == []
    return code, done.stdout, peak_kb / 1024
