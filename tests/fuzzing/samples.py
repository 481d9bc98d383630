"""Small valid files in every format, and where their parts begin: what the mutations start from.

Written by hand from the formats' descriptions, without the project's readers and writers, so that
the same seed gives the same bytes wherever it is run.
"""

from __future__ import annotations

import codecs
import gzip
import io
import json
import struct
import tarfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzzing.e57 import e57_file, seal_pages
from tests.support.paths import FIGURE_4, FORMATS

ROWS = 40


def as_it_is(data: bytes) -> bytes:
    return data


@dataclass(frozen=True)
class Sample:
    """A file, or the inside of one.

    file: its name as the reader sees it. sections: offsets where a part begins. seal: what makes a
    file of the mutated bytes: nothing, checksums put right, or a wrapper around them. door: which
    part of the program opens it. given: what the user states of it.
    """

    name: str
    file: str
    data: bytes
    sections: tuple[int, ...]
    seal: Callable[[bytes], bytes] = as_it_is
    door: str = "scan"
    given: dict[str, Any] = field(default_factory=dict)

    @property
    def format(self) -> str:
        """The suffix, or the door."""
        return self.file.partition(".")[2] if self.door == "scan" else self.door


def samples(folder: Path = FORMATS) -> tuple[Sample, ...]:
    """The files in `folder`, those written here, the same inside of wrappers, and captures."""
    files = {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.suffix != ".md"}
    given = [Sample(name, name, data, sections(name, data)) for name, data in files.items()]
    made = [
        Sample(name, name, data, sections(name, data), given=GIVEN.get(name, {}))
        for name, data in (scans() | heights()).items()
    ]
    return (*given, *made, *_sealed(given + made), *_wrapped(scans()), *_captures(scans()))


PITCH = (0.5, 0.25)
# What must be stated of some samples: their unit, columns or pitch.
GIVEN: dict[str, dict[str, Any]] = {
    "rows.xyz": {"columns": ("row", "col", "x", "y", "z", "i")},
    "raster-counts.npy": {"columns": ("row", "col", "x", "y", "z", "i")},
    "matrix.csv": {"pitch": PITCH},
    "matrix.npy": {"pitch": PITCH},
    "part.csv": {"length_unit": "mm"},
    "cloud.csv": {"length_unit": "mm"},
    "model.3mf": {"length_unit": "mm"},
}


def scans() -> dict[str, bytes]:
    """A scan in each format, by file name: a tilted plane with noise, 40 points."""
    rng = np.random.default_rng(5)
    xyz = np.round(rng.uniform(-1, 1, (ROWS, 3)) @ np.diag([1.0, 1.0, 0.01]) + [3.0, 1.0, 0.0], 4)
    shade = np.arange(ROWS) % 7 / 8.0
    table = np.empty(ROWS, [("xyz", "<f8", 3), ("shade", "<f4")])
    table["xyz"], table["shade"] = xyz, shade
    rows = [f"{x:.4f} {y:.4f} {z:.4f} {s:.3f}" for (x, y, z), s in zip(xyz, shade, strict=True)]
    return {
        **_ply_files(xyz, table, rows),
        **_pcd_files(xyz, shade, table, rows),
        **_text_files(rows),
        **_exported_text(rows),
        **_numpy_files(xyz, table),
        **_mesh_files(xyz),
        **_library_meshes(xyz),
        "las-12.las": las_file(xyz, shade, version=2),
        "las-14.las": las_file(xyz, shade, version=4),
        "posed.e57": e57_file(xyz),
    }


def _ply_files(xyz: np.ndarray, table: np.ndarray, rows: list[str]) -> dict[str, bytes]:
    def head(encoding: str, number: str, rest: str = "") -> bytes:
        columns = "".join(f"property {number} {axis}\n" for axis in "xyz")
        return (
            f"ply\nformat {encoding} 1.0\ncomment made\nelement vertex {ROWS}\n{columns}"
            f"property float intensity\n{rest}end_header\n"
        ).encode()

    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    face_bytes = b"".join(struct.pack("<B3i", 3, k, k + 1, k + 2) for k in range(2))
    big = table.astype([("xyz", ">f8", 3), ("shade", ">f4")])
    return {
        "ascii.ply": head("ascii", "double") + "\n".join(rows).encode() + b"\n",
        "faces.ply": head("ascii", "float", faces)
        + ("\n".join([*rows, "3 0 1 2", "4 0 1 2 3"]) + "\n").encode(),
        "little.ply": head("binary_little_endian", "double", faces) + table.tobytes() + face_bytes,
        "big.ply": head("binary_big_endian", "double") + big.tobytes(),
    }


def _pcd_files(
    xyz: np.ndarray, shade: np.ndarray, table: np.ndarray, rows: list[str]
) -> dict[str, bytes]:
    def head(encoding: str) -> bytes:
        return (
            "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 8 8 8 4\nTYPE F F F F\n"
            f"COUNT 1 1 1 1\nWIDTH {ROWS}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {ROWS}\n"
            f"DATA {encoding}\n"
        ).encode()

    plain = np.ascontiguousarray(xyz.T, "<f8").tobytes() + shade.astype("<f4").tobytes()
    # Runs of 32 bytes, then one reference of 132 bytes to 28 bytes before: the shades repeat.
    runs = [plain[k : k + 32] for k in range(0, len(plain) - 132, 32)]
    runs[-1] = runs[-1][: (len(plain) - 132) % 32 or 32]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    packed += bytes([7 << 5, 132 - 9, 28 - 1])
    sizes = struct.pack("<II", len(packed), len(plain))
    pages = (head("binary_compressed") + sizes + packed).ljust(4096, b"\0")  # as PCL writes them
    return {
        "pages.pcd": pages,
        "ascii.pcd": head("ascii") + "\n".join(rows).encode() + b"\n",
        "binary.pcd": head("binary") + table.tobytes(),
        "packed.pcd": head("binary_compressed") + sizes + packed,
    }


def _text_files(rows: list[str]) -> dict[str, bytes]:
    plain = "\n".join(rows) + "\n"
    names = "x,y,z,intensity\n"
    comma = plain.replace(".", ",").replace(" ", ";")
    holes = ["0 0 0 0.5" if k % 5 == 2 else row for k, row in enumerate(rows)]
    turn = "0 1 0\n-1 0 0\n0 0 1\n"
    posed = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n1 2 3 1\n"
    rest = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    grids = (
        f"5\n4\n1 2 3\n{turn}{posed}" + "\n".join(holes[:20]) + "\n",
        f"4\n5\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{rest}" + "\n".join(holes[20:]) + "\n",
    )
    return {
        "blanks.xyz": plain.encode(),
        "crlf.txt": f"# made\n{ROWS}\n{plain}".replace("\n", "\r\n").encode(),
        "names.csv": (names + plain.replace(" ", ",")).encode(),
        "decimal-comma.csv": comma.encode(),
        "count.pts": f"{ROWS}\n{plain}".encode(),
        "blocks.pts": ("25\n" + "\n".join(rows[:25]) + "\n15\n" + "\n".join(rows[25:])).encode()
        + b"\n",
        "posed.ptx": "".join(grids).encode(),
    }


def _exported_text(rows: list[str]) -> dict[str, bytes]:
    """The same points as exporters write them: what stands around the rows and in their cells."""
    plain = "\n".join(rows) + "\n"
    labels = "".join(f"P{k:02d};{row.replace(' ', ';')}\n" for k, row in enumerate(rows))
    raster = "".join(f"{k // 8} {k % 8} {row}\n" for k, row in enumerate(rows))
    quoted = "".join('"' + row.replace(" ", '","') + '"\n' for row in rows)
    units = "X [m];Y [m];Z [m];Intensity\nm;m;m;-\n"
    holes = [
        row if k % 9 else f"{row.split()[0]} 1.#QNAN -1.#IND 0.5" for k, row in enumerate(rows)
    ]
    empty = [row if k % 9 else f"{row.split()[0]} N/A  0.5" for k, row in enumerate(rows)]
    return {
        "names.asc": f"//X Y Z Intensity\n{ROWS}\n{plain}".encode(),
        "prose.txt": (
            f"Export of a scan\n[Data]\n{units}{plain.replace(' ', ';')}End of file\n"
        ).encode(),
        "labels.csv": f"Name;X;Y;Z;I\n{labels}".encode(),
        "bare-labels.csv": labels.encode(),
        "rows.xyz": raster.encode(),
        "quoted.csv": f'"Points:0","Points:1","Points:2","Intensity"\n{quoted}'.encode(),
        "holes.xyz": ("\n".join(holes) + "\n").encode(),
        "empty.csv": ("x,y,z,i\n" + "\n".join(empty).replace(" ", ",") + "\n").encode(),
        "ends.csv": plain.replace(" ", ",").replace("\n", ",\n").encode(),
        "wide.txt": codecs.BOM_UTF16_LE + plain.replace(" ", "\t").encode("utf-16-le"),
        "names.pts": f"# made\n{ROWS}\n//X,Y,Z,Intensity\n{plain.replace(' ', ',')}".encode(),
    }


def heights() -> dict[str, bytes]:
    """Matrices of heights, and the two sections of Gocator's CSV."""
    z = np.round(np.random.default_rng(6).normal(-1.0, 0.1, (8, 20)), 4)
    cells = [[f"{value:.4f}" for value in row] for row in z]
    cells[2][5:9] = ["-99999.9999"] * 4
    matrix = "\n".join(",".join(row) for row in cells) + "\n"
    info = "Info\nCSV Version,Sensor Count\n2,1\nEnd\n"
    names = "Frame,Row Count,Column Count\n"
    positions = ",".join(f"{PITCH[0] * k:.2f}" for k in range(20))
    body = "".join(f"{PITCH[1] * k:.2f},{','.join(row)}\n" for k, row in enumerate(cells))
    part = f"{info}Part\n{names}0,8,20\nY,{positions}\n{body}End\n"
    points = "\n".join(",".join(row[:15]) for row in cells) + "\n"
    cloud = f"{info}SurfacePointCloud\n{names}0,8,5\n0,1,2,3,4\n{points}End\n"
    stream = io.BytesIO()
    np.save(stream, z)
    return {
        "matrix.csv": matrix.encode(),
        "pitch.csv": f"X pitch,0.5,m\nY pitch,0.25,m\n{matrix}".encode(),
        "grid.asc": f"ncols 20\nnrows 8\ncellsize 0.5\nNODATA_value -9\n{matrix}".encode(),
        "matrix.npy": stream.getvalue(),
        "part.csv": part.encode(),
        "cloud.csv": cloud.encode(),
    }


def _numpy_files(xyz: np.ndarray, table: np.ndarray) -> dict[str, bytes]:
    def npy(array: np.ndarray) -> bytes:
        stream = io.BytesIO()
        np.save(stream, array)
        return stream.getvalue()

    four = np.column_stack([xyz, table["shade"]])
    counts = np.column_stack([*np.mgrid[:5, :8].reshape(2, -1), four])
    fields = np.empty(ROWS, [("label", "S3"), ("Z", ">f8"), ("Y", "<f8"), ("X", "<f8")])
    fields["label"], fields["X"], fields["Y"], fields["Z"] = b"abc", *xyz.T
    return {
        "raster.npy": npy(xyz.reshape(5, 8, 3)),
        "raster-columns.npy": npy(np.asfortranarray(xyz.reshape(5, 8, 3).transpose(1, 0, 2))),
        "raster-counts.npy": npy(counts),
        "six.npy": npy(np.column_stack([xyz, xyz])),
        "fields.npy": npy(fields.reshape(8, 5)),
        "rows.npy": npy(four),
        "columns.npy": npy(np.asfortranarray(xyz)),
        "single.npy": npy(xyz.astype(">f4")),
        "one.npz": zipped({"points.npy": npy(xyz)}),
        "packed.npz": zipped(
            {"points.npy": npy(xyz), "intensity.npy": npy(table["shade"].copy())}, packed=True
        ),
    }


def _mesh_files(xyz: np.ndarray) -> dict[str, bytes]:
    corners = xyz[: ROWS - ROWS % 3].reshape(-1, 3, 3).astype("<f4")
    binary = bytearray(b"made".ljust(80, b" ") + struct.pack("<I", len(corners)))
    lines = ["solid made"]
    for corner in corners:
        binary += bytes(12) + corner.tobytes() + bytes(2)
        vertices = [f"vertex {x:.4f} {y:.4f} {z:.4f}" for x, y, z in corner]
        lines += ["facet normal 0 0 1", "outer loop", *vertices, "endloop", "endfacet"]
    lines += ["endsolid made", ""]
    solids = "\n".join([*lines, *lines]).replace("solid made\n", "solid\n", 1)
    obj = ["# made", *(f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in xyz), "f 1 2 3", "f 2/1 3/1 4/1"]
    return {
        "binary.stl": bytes(binary),
        "ascii.stl": "\n".join(lines).encode(),
        "solids.stl": solids.encode(),
        "faces.obj": ("\n".join(obj) + "\n").encode(),
        "points.obj": "\n".join(obj[:-2]).encode() + b"\n",
    }


def _library_meshes(xyz: np.ndarray) -> dict[str, bytes]:
    """OFF, binary glTF and 3MF: the library reads them."""
    faces = [(k, k + 1, k + 2) for k in range(0, 30, 3)]
    off = ["OFF # made", f"{ROWS} {len(faces)} 0", *(f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in xyz)]
    off += [f"3 {a} {b} {c}" for a, b, c in faces]
    flat, index = xyz.astype("<f4").tobytes(), np.array(faces, "<u4").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0.0, 0.0, 0.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": ROWS, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 3 * len(faces), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(flat)},
            {"buffer": 0, "byteOffset": len(flat), "byteLength": len(index)},
        ],
        "buffers": [{"byteLength": len(flat + index)}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    glb = struct.pack("<I4s", len(text), b"JSON") + text
    glb += struct.pack("<I4s", len(flat + index), b"BIN\0") + flat + index
    vertices = "".join(f'<vertex x="{x:.1f}" y="{y:.1f}" z="{z:.1f}"/>' for x, y, z in xyz * 1e3)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces)
    model = (
        '<?xml version="1.0"?><model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        f'<object id="1" type="model"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    return {
        "faces.off": ("\n".join(off) + "\n").encode(),
        "mesh.glb": struct.pack("<4sII", b"glTF", 2, 12 + len(glb)) + glb,
        "model.3mf": zipped({"3D/3dmodel.model": model.encode()}, packed=True),
    }


def las_file(xyz: np.ndarray, shade: np.ndarray, version: int) -> bytes:
    """LAS 1.2 of point format 0, or 1.4 of format 6. Source: ASPRS LAS 1.4-R15, tables 3-17."""
    form, size, length = (0, 227, 20) if version == 2 else (6, 375, 30)
    counts = (len(xyz), len(xyz), 0, 0, 0, 0) if form == 0 else (0,) * 6
    head = struct.pack(
        "<4sHHIHH8sBB32s32sHHHIIBHI5I",
        *(b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, version, b"made", b"made", 1, 2020),
        *(size, size, 0, form, length, *counts),
    )
    bounds = np.stack([xyz.max(axis=0), xyz.min(axis=0)], axis=1).ravel()
    head += struct.pack("<12d", *[1e-4] * 3, *[0.0] * 3, *bounds)
    if version == 4:
        head += struct.pack("<QQIQ15Q", 0, 0, 0, len(xyz), len(xyz), *[0] * 14)
    assert len(head) == size
    body = b""
    for (x, y, z), brightness in zip(np.rint(xyz * 1e4).astype(int), shade, strict=True):
        body += struct.pack("<3iH", x, y, z, int(brightness * 65535)).ljust(length, b"\0")
    return head + body


def zipped(files: dict[str, bytes], packed: bool = False) -> bytes:
    """A zip archive of no date."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            member = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
            archive.writestr(member, data)
    return stream.getvalue()


def tarred(files: dict[str, bytes]) -> bytes:
    """A tar archive of no date."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return stream.getvalue()


def gzipped(data: bytes) -> bytes:
    """A gzip file of no date."""
    return gzip.compress(data, mtime=0)


def _sealed(plain: list[Sample]) -> list[Sample]:
    """E57 and GLB again, checksums and size of what is mutated put right: they are no shield."""
    seals = {"e57": seal_pages, "glb": seal_size}
    return [
        Sample(f"sealed:{s.name}", s.file, s.data, s.sections, seals[s.format])
        for s in plain
        if s.format in seals
    ]


def seal_size(data: bytes) -> bytes:
    """A binary glTF whose header states its own size."""
    return data if len(data) < 12 else data[:8] + struct.pack("<I", len(data)) + data[12:]


def _wrapped(files: dict[str, bytes]) -> list[Sample]:
    """Scans in gzip and zip: once the wrapper is mutated, once what it holds."""
    made = []
    for name in ("little.ply", "blanks.xyz", "binary.pcd", "posed.ptx", "las-12.las"):
        data, file = files[name], f"{name}.gz"
        outer = gzipped(data)
        made.append(Sample(f"outer:{file}", file, outer, (10, len(outer) - 8)))
        made.append(Sample(f"inner:{file}", file, data, sections(name, data), gzipped))
    member = zipfile.ZipFile(io.BytesIO(files["one.npz"])).read("points.npy")
    inside = Sample(
        "inner:one.npz",
        "one.npz",
        member,
        sections("points.npy", member),
        lambda data: zipped({"points.npy": data}),
    )
    wide = Sample(
        "inner:wide.txt",
        "wide.txt",
        files["crlf.txt"],
        _lines(files["crlf.txt"]),
        lambda data: codecs.BOM_UTF16_BE + data.decode("latin-1").encode("utf-16-be"),
    )
    model = zipfile.ZipFile(io.BytesIO(files["model.3mf"])).read("3D/3dmodel.model")
    inner_model = Sample(
        "inner:model.3mf",
        "model.3mf",
        model,
        sections("model.xml", model),
        lambda data: zipped({"3D/3dmodel.model": data}),
        given=GIVEN["model.3mf"],
    )
    return [*made, inside, wide, inner_model]


CAPTURE_TOML = """vehicle = "AA-00-BB"
length_unit = "m"
[target]
shape = "disc"
diameter = 0.25
[reference]
RR = "rr.ply"
RL = "rl.xyz"
FR = "fr.pcd"
FL = "fl.npy"
[[trial]]
name = "1"
file = "trial-1.csv"
wheel = "RR"
"""


WHEEL = {
    **{"name": "RR", "role": "reference", "wheel": "RR", "status": "ok", "points_on_target": 12},
    **dict.fromkeys(("toe_deg", "camber_deg", "u_toe_deg", "u_camber_deg", "plane_rms_m"), 0.125),
    "points_total": 40,
}
BATCH = {"key": "k", "kind": "folder", "status": "ok", "date": "2026-11-20", "config_sha256": "0"}
RESULT = json.dumps(
    {
        **{"schema": "wheelplane/measurement/1", "capture": "one", "vehicle_name": "AA-00-BB"},
        **{"wheels": [WHEEL, WHEEL], "frame": {"rear_track_m": 1.5, "u_rear_track_m": 0.001}},
        **{"vehicle": {"rear_total_toe_deg": 0.25, "u_rear_total_toe_deg": 0.125}},
        **{"batch": BATCH, "provenance": {"version": "1"}},
    },
    indent=1,
).encode()


def capture_files(files: dict[str, bytes]) -> dict[str, bytes]:
    """A whole capture, by file name, with its capture.toml."""
    return {
        "capture.toml": CAPTURE_TOML.encode(),
        "rr.ply": files["little.ply"],
        "rl.xyz": files["blanks.xyz"],
        "fr.pcd": files["binary.pcd"],
        "fl.npy": files["rows.npy"],
        "trial-1.csv": files["names.csv"],
    }


def _captures(files: dict[str, bytes]) -> list[Sample]:
    inside = capture_files(files)
    made = []
    archives = {
        "capture.zip": zipped(inside),
        "packed.zip": zipped(inside, packed=True),
        "capture.tar": tarred(inside),
        "capture.tar.gz": gzipped(tarred(inside)),
    }
    for name, data in archives.items():
        made.append(Sample(name, name, data, sections(name, data), door="capture"))
    made.append(
        Sample(
            "inner:capture.zip",
            "capture.zip",
            inside["rr.ply"],
            sections("rr.ply", inside["rr.ply"]),
            lambda data: zipped(inside | {"rr.ply": data}),
            door="capture",
        )
    )
    toml = CAPTURE_TOML.encode()
    made.append(Sample("capture.toml", "capture.toml", toml, _lines(toml), door="capture.toml"))
    made.append(Sample("result.json", "result.json", RESULT, _lines(RESULT), door="result"))
    paper = FIGURE_4.read_bytes()
    made.append(Sample("figure-4.txt", "five.txt", paper, _lines(paper), door="five-point"))
    return made


MARKS = {
    ".ply": (b"element vertex", b"property", b"end_header\n"),
    ".pcd": (b"FIELDS", b"SIZE", b"WIDTH", b"POINTS", b"DATA"),
    ".npy": (b"{'descr'", b"'shape'", b"\n"),
    ".npz": (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06", b"{'descr'"),
    ".zip": (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"),
    ".e57": (b"<?xml", b"<data3D", b"<pose", b"<points", b"<prototype", b"</points>"),
    ".stl": (b"facet", b"endfacet", b"endsolid"),
    ".glb": (b"JSON", b"BIN", b'"nodes"', b'"meshes"', b'"accessors"', b'"bufferViews"'),
    ".3mf": (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06"),
    ".xml": (b"<model", b"<vertices>", b"<vertex", b"<triangle", b"<build>", b"<item"),
}
STEPS = {".e57": (48, 80, 1024, 2048), ".las": (227, 375), ".laz": (227, 375), ".stl": (80, 84)}


def sections(name: str, data: bytes) -> tuple[int, ...]:
    """Offsets where the parts of a file begin: at its marks, sizes known by heart, or its lines."""
    suffix = Path(name).suffix
    if suffix in (".xyz", ".asc", ".csv", ".txt", ".pts", ".ptx", ".obj", ".off"):
        return _lines(data)
    if suffix == ".tar":
        return tuple(range(512, len(data), 512))
    found = {step for step in STEPS.get(suffix, ()) if step < len(data)}
    for mark in MARKS.get(suffix, ()):
        at = data.find(mark)
        while at >= 0 and len(found) < 200:
            found |= {at, at + len(mark)}
            at = data.find(mark, at + 1)
    return tuple(sorted(found - {0})) or (len(data) // 2,)


def _lines(data: bytes) -> tuple[int, ...]:
    return tuple(k + 1 for k, byte in enumerate(data) if byte == 10)
