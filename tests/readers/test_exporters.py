"""The manual's table of exporters: each of its rows, with a file as that program writes it."""

from __future__ import annotations

import codecs
import io
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from tests.support.paths import ROOT
from wheelplane.errors import InputError
from wheelplane.readers import ReadOptions, read_scan

MANUAL = ROOT / "pipeline" / "manual" / "17-formats.md"
XYZ = np.round(np.random.default_rng(11).uniform(-2.0, 2.0, (12, 3)), 3)
RGB = np.random.default_rng(12).integers(0, 256, (12, 3))
GREY = np.float32(0.2126 * RGB[:, 0] + 0.7152 * RGB[:, 1] + 0.0722 * RGB[:, 2]).tolist()
SHADE = np.random.default_rng(13).integers(-2048, 2048, 12)
GONE = (2, 7)  # beams without a return
KEPT = [k for k in range(12) if k not in GONE]


@dataclass(frozen=True)
class Written:
    """A file and what must come of it: points in the file's unit, or a refusal.

    given: what the user states. refused: without what is given, or ever if nothing is.
    """

    name: str
    data: bytes
    points: np.ndarray | None = None
    intensity: list[float] | None = None
    missing: int = 0
    given: dict[str, Any] = field(default_factory=dict)
    refused: str | None = None


ROWS: dict[tuple[str, str], Callable[[], Written]] = {}


def row(exporter: str, writes: str) -> Callable[[Callable[[], Written]], Callable[[], Written]]:
    """Register a row of the table by its first two cells."""

    def add(make: Callable[[], Written]) -> Callable[[], Written]:
        ROWS[exporter, writes] = make
        return make

    return add


def lines(*columns, mark=" ", form="{:g}"):
    table = np.column_stack(columns)
    return "".join(mark.join(form.format(x) for x in values) + "\n" for values in table)


@row("CloudCompare", "`.asc`, `.txt`: `//X Y Z R G B Intensity`, number of points, rows")
def cloudcompare_text():
    text = f"//X Y Z R G B Intensity\n12\n{lines(XYZ, RGB, SHADE)}"
    return Written("a.asc", text.encode(), XYZ, SHADE.tolist())


@row("CloudCompare", "`.ply` with `scalar_Intensity`")
def cloudcompare_ply():
    head = "ply\nformat binary_little_endian 1.0\ncomment Created by CloudCompare\n"
    head += "element vertex 12\nproperty double x\nproperty double y\nproperty double z\n"
    head += "property float scalar_Intensity\nend_header\n"
    body = b"".join(struct.pack("<3df", *p, s) for p, s in zip(XYZ, SHADE, strict=True))
    return Written("a.ply", head.encode() + body, XYZ, SHADE.tolist())


@row("Cyclone", "`.pts`: number of points, rows of `x y z i r g b`")
def cyclone_pts():
    return Written("a.pts", f"12\n{lines(XYZ, SHADE, RGB)}".encode(), XYZ, SHADE.tolist())


@row("Cyclone", "`.ptx`: posed rasters, `0 0 0` where nothing was met")
def cyclone_ptx():
    gone = XYZ.copy()
    gone[list(GONE)] = 0.0
    pose = "1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n"
    text = f"4\n3\n{pose}{lines(gone, np.full(12, 0.5))}"
    return Written("a.ptx", text.encode(), XYZ[KEPT] + np.array([1.0, 2, 3]), [0.5] * 10, 2)


@row("SCENE", "`.xyz` with row and column: `row col x y z r g b`, no names")
def scene_rows():
    text = lines(np.arange(12) // 4 + 820, np.arange(12) % 4 + 3401, XYZ, RGB)
    names = ("row", "col", "x", "y", "z", "r", "g", "b")
    says = "its first two columns are whole numbers, as of a raster, and no column has a name"
    return Written("a.xyz", text.encode(), XYZ, GREY, given={"columns": names}, refused=says)


@row("SCENE", "`.xyz`: `x y z r g b`")
def scene_plain():
    return Written("a.xyz", lines(XYZ, RGB).encode(), XYZ)


@row("SCENE, RealWorks, RiSCAN, ReCap", "`.fls`, `.lsproj`, `.tzf`, `.rdbx`, `.rcp`")
def raw_formats():
    return Written("a.fls", b"raw", refused="raw format of FARO SCENE, .*: export E57, PTX or XYZ")


@row("PolyWorks", "`.txt`: comments, rows of `x y z i j k` (normals)")
def polyworks():
    normals = np.round(XYZ / np.linalg.norm(XYZ, axis=1)[:, None], 4)
    return Written("a.txt", f"# PolyWorks\n# points\n{lines(XYZ, normals)}".encode(), XYZ)


@row("GOM, ZEISS", "`.asc` in mm: comments, rows of `x y z`")
def gom_text():
    text = f"# Exported point cloud\n# unit: mm\n{lines(XYZ * 1e3, form='{:.6f}')}"
    return Written("a.asc", text.encode(), XYZ * 1e3, given={"length_unit": "mm"})


@row("GOM, ZEISS", "`.stl` in mm, text of several solids")
def gom_stl():
    def solid(corners):
        facets = ""
        for triangle in corners.reshape(-1, 3, 3):
            rows = "".join(f"   vertex {x} {y} {z}\n" for x, y, z in triangle)
            facets += f" facet normal 0 0 1\n  outer loop\n{rows}  endloop\n endfacet\n"
        return f"solid part\n{facets}endsolid part\n"

    data = (solid(XYZ[:6]) + solid(XYZ[6:])).encode()
    return Written("a.stl", data, XYZ, given={"length_unit": "mm"})


def without_returns(none=np.nan):
    table = XYZ * 1e3
    table[list(GONE)] = none
    return table


@row("Zivid", "`.xyz` in mm: `x y z r g b`, `nan` where nothing was met")
def zivid_text():
    text = lines(without_returns(), RGB, form="{:.6f}")
    return Written("a.xyz", text.encode(), XYZ[KEPT] * 1e3, None, 2, {"length_unit": "mm"})


@row("Zivid", "`.pcd` in mm: a raster with `nan`")
def zivid_pcd():
    head = "VERSION 0.7\nFIELDS x y z rgba\nSIZE 4 4 4 4\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 4\n"
    head += "HEIGHT 3\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 12\nDATA binary\n"
    body = b"".join(struct.pack("<3fI", *p, 7) for p in without_returns())
    single = np.float64(np.float32(XYZ[KEPT] * 1e3))
    grey = [float(np.float32(0.0722 * 7))] * 10
    return Written("a.pcd", head.encode() + body, single, grey, 2, {"length_unit": "mm"})


@row("Zivid", "`.npy` in mm: the array (H, W, 3) of `copy_data`")
def zivid_array():
    stream = io.BytesIO()
    np.save(stream, without_returns().reshape(3, 4, 3))
    given = {"length_unit": "mm"}
    return Written("a.npy", stream.getvalue(), XYZ[KEPT] * 1e3, None, 2, given)


@row("Zivid, Photoneo", "`.zdf`, `.praw`")
def camera_raw():
    return Written("a.zdf", b"raw", refused="raw format of Zivid Studio, .*: export PLY, PCD or X")


@row("Photoneo", "`.ply` in mm: a raster of points with normals")
def photoneo():
    names = ("x", "y", "z", "nx", "ny", "nz")
    head = "ply\nformat ascii 1.0\nobj_info num_cols = 4\nobj_info num_rows = 3\n"
    head += "element vertex 12\n" + "".join(f"property float {name}\n" for name in names)
    text = f"{head}end_header\n{lines(XYZ * 1e3, np.tile([0, 0, 1], (12, 1)), form='{:.4f}')}"
    return Written("a.ply", text.encode(), XYZ * 1e3, given={"length_unit": "mm"})


@row("RealSense", "`.ply`, binary: vertices with colours, faces")
def realsense():
    head = "ply\nformat binary_little_endian 1.0\ncomment pointcloud saved from Realsense Viewer\n"
    head += "element vertex 12\nproperty float32 x\nproperty float32 y\nproperty float32 z\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    body = b"".join(struct.pack("<3f3B", *p, *c) for p, c in zip(XYZ, RGB.tolist(), strict=True))
    body += struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B3i", 3, 1, 2, 3)
    return Written("a.ply", head.encode() + body, np.float64(np.float32(XYZ)), GREY)


HEIGHTS = np.round(np.random.default_rng(14).normal(1.0, 0.2, (5, 15)), 4)
STEP = (0.05, 0.1)


def on_a_grid(heights, step=STEP):
    y, x = np.mgrid[: heights.shape[0], : heights.shape[1]]
    points = np.stack([x * step[0], y * step[1], heights], axis=-1).reshape(-1, 3)
    return points[np.isfinite(points).all(axis=1)]


def profiles(none="-99999.9999"):
    heights = HEIGHTS.copy()
    heights[1, 3:6] = np.nan
    cells = [[none if np.isnan(z) else f"{z:.4f}" for z in row] for row in heights]
    return heights, "".join(",".join(row) + "\n" for row in cells)


@row("Keyence", "`.csv` of LJ-X, LJ-S: a profile a row, `-99999.9999` where nothing was met")
def keyence():
    heights, text = profiles()
    says = "line 1 has 15 columns without names: .* give --pitch DX,DY"
    given = {"pitch": STEP}
    return Written("a.csv", text.encode(), on_a_grid(heights), None, 3, given, says)


@row("Keyence", "`.csv` of heights below a header with the pitch and the unit")
def keyence_header():
    heights, text = profiles()
    head = '"Model","LJ-X8000"\n"X pitch","50","um"\n"Y pitch","100","um"\n"Unit","mm"\n\n'
    says = "the file states lengths in mm, but they would be taken as m: give --length-unit mm"
    given = {"length_unit": "mm"}
    return Written("a.csv", (head + text).encode(), on_a_grid(heights), None, 3, given, says)


SECTIONS = "Info\nCSV Version,Sensor Count\n2,1\nEnd\nDeviceInfo\nID,Model\n1,2\nEnd\n"


@row("Gocator", "`.csv`, section `Part` or `Surface`: a row of x, rows of y and heights, in mm")
def gocator_part():
    heights, text = profiles("")
    x = ",".join(f"{STEP[0] * k:.2f}" for k in range(15))
    rows = "".join(f"{STEP[1] * k:.2f},{cells}\n" for k, cells in enumerate(text.split()))
    text = f"{SECTIONS}Part\nFrame,Row Count,Column Count\n0,5,15\nY\\X,{x}\n{rows}End\n"
    says = "the file states lengths in mm"
    given = {"length_unit": "mm"}
    return Written("a.csv", text.encode(), on_a_grid(heights), None, 3, given, says)


@row("Gocator", "`.csv`, section `SurfacePointCloud`: rows of x, y, z of each point, in mm")
def gocator_cloud():
    cells = "".join(",".join(f"{x:.3f}" for x in row) + "\n" for row in XYZ.reshape(3, 12))
    head = "SurfacePointCloud\nFrame,Row Count,Column Count\n0,3,4\n0,1,2,3\n"
    text = f"{SECTIONS}{head}{cells}End\n"
    given = {"length_unit": "mm"}
    return Written("a.csv", text.encode(), XYZ, given=given, refused="states lengths in mm")


@row("Artec", "`.obj` in mm: `v x y z r g b`, faces")
def artec():
    body = "".join("v " + line for line in lines(XYZ * 1e3, RGB / 255).splitlines(keepends=True))
    text = f"# Artec Studio\nmtllib a.mtl\n{body}f 1 2 3\nf 4/1 5/1 6/1\n"
    return Written("a.obj", text.encode(), XYZ * 1e3, given={"length_unit": "mm"})


@row("ParaView", '`.csv`: `"Intensity","Points:0","Points:1","Points:2"`')
def paraview():
    head = '"Intensity","Points:0","Points:1","Points:2"\n'
    return Written("a.csv", (head + lines(SHADE, XYZ, mark=",")).encode(), XYZ, SHADE.tolist())


@row(
    "spreadsheets",
    "`.csv`: `;`, decimal commas, a title, names, a row of units, empty cells, `#N/A`",
)
def spreadsheet():
    cells = lines(XYZ, mark=";").replace(".", ",").splitlines()
    cells[GONE[0]] = ";;"
    cells[GONE[1]] = "#N/A;1,5;2,5"
    body = "".join(f"P{k};{cell};\n" for k, cell in enumerate(cells))
    text = f"\ufeffWheel scan;;;;\nName;X;Y;Z;\n;m;m;m;\n{body}"
    return Written("a.csv", text.replace("\n", "\r\n").encode(), XYZ[KEPT], None, 2)


@row("spreadsheets", '`.txt`, "Unicode text": UTF-16, tabs')
def unicode_text():
    text = "X\tY\tZ\r\n" + lines(XYZ, mark="\t").replace("\n", "\r\n")
    return Written("a.txt", codecs.BOM_UTF16_LE + text.encode("utf-16-le"), XYZ)


@row("spreadsheets", "names with units: `X [mm]`, `x(mm)`, `X_mm`")
def units():
    text = "X [mm],Y [mm],Z [mm]\n" + lines(XYZ, mark=",")
    says = "the file states lengths in mm, but they would be taken as m"
    return Written("a.csv", text.encode(), XYZ, given={"length_unit": "mm"}, refused=says)


@row("programs built with older Microsoft compilers", "`1.#QNAN`, `-1.#IND`, `1.#INF` in any text")
def microsoft():
    rows = lines(XYZ).splitlines()
    rows[GONE[0]], rows[GONE[1]] = "1.#QNAN -1.#IND 1.#INF", "0.5 0.5 1.#QNAN0"
    return Written("a.xyz", ("\n".join(rows) + "\n").encode(), XYZ[KEPT], None, 2)


def read(path, given):
    unit = given.get("length_unit", "m")
    options = {name: value for name, value in given.items() if name != "length_unit"}
    return read_scan(path, unit, path.name, ReadOptions(**options))


@pytest.mark.parametrize("key", ROWS, ids=lambda key: f"{key[0]}: {key[1]}"[:60])
def test_a_row_of_the_table_is_true(tmp_path, key):
    written = ROWS[key]()
    path = tmp_path / written.name
    path.write_bytes(written.data)
    if written.refused is not None:
        with pytest.raises(InputError, match=written.refused) as caught:
            read(path, {})
        assert len(str(caught.value).splitlines()) == 1
    if written.points is None:
        return
    scan = read(path, written.given)
    scale = 1e3 if written.given.get("length_unit") == "mm" else 1.0
    np.testing.assert_allclose(scan.points_m * scale, written.points, rtol=1e-12, atol=1e-12)
    assert scan.invalid_points == written.missing
    assert (None if scan.intensity is None else scan.intensity.tolist()) == written.intensity


def test_every_row_of_the_table_has_a_test():
    text = MANUAL.read_text("utf-8").partition("## What exporters write")[2].partition("\n## ")[0]
    rows = [
        re.split(r"(?<!\\) \| ", line.strip("| ")) for line in text.splitlines() if line[:1] == "|"
    ]
    found = {(cells[0], cells[1]) for cells in rows[2:]}
    assert found == set(ROWS)
