"""Structurally generated files: any valid header, and what must be read from behind it.

Strategies draw a Written file: its bytes, the points in it, and the same bytes under headers that
lie about a count.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

SCALARS = {
    "b": ("char", "int8", "I1"),
    "B": ("uchar", "uint8", "U1"),
    "h": ("short", "int16", "I2"),
    "H": ("ushort", "uint16", "U2"),
    "i": ("int", "int32", "I4"),
    "I": ("uint", "uint32", "U4"),
    "f": ("float", "float32", "F4"),
    "d": ("double", "float64", "F8"),
}
SMALL = st.integers(0, 100)  # exact in every type
LIES = (-1, 1, 7, 10**6, 2**31, 2**63)


@dataclass(frozen=True)
class Written:
    """A file: the points that it holds in metres, in the file's order, and lies about their count.

    missing: rows without a return, which are counted and not among the points.
    """

    data: bytes
    points: np.ndarray
    missing: int
    lies: tuple[bytes, ...]


def _lying(make: Callable[[int], bytes], count: int) -> tuple[bytes, ...]:
    return tuple(make(count + lie) for lie in LIES if count + lie >= 0)


@st.composite
def ply(draw: st.DrawFn) -> Written:
    """Elements in any order, scalars and lists of any type, three encodings."""
    encoding = draw(st.sampled_from(["ascii", "binary_little_endian", "binary_big_endian"]))
    order = ">" if "big" in encoding else "<"
    scalar = st.sampled_from(sorted(SCALARS))
    extra = draw(st.lists(st.tuples(st.sampled_from(["nx", "red", "scan"]), scalar), max_size=3))
    columns = draw(st.permutations([*((a, draw(scalar)) for a in "xyz"), *dict(extra).items()]))
    count = draw(st.integers(1, 5))
    rows = draw(st.lists(st.tuples(*[SMALL] * len(columns)), min_size=count, max_size=count))
    around = [draw(st.none() | st.tuples(scalar, st.lists(st.lists(SMALL, max_size=3), max_size=3)))
              for _ in range(2)]  # fmt: skip

    def body(form: str, values: tuple[int, ...]) -> bytes:
        if encoding == "ascii":
            return (" ".join(map(str, values)) + "\n").encode()
        return struct.pack(order + form, *values)

    def lists(item: str, records: list[list[int]]) -> bytes:
        if encoding == "ascii":
            return "".join(" ".join(map(str, [len(r), *r])) + "\n" for r in records).encode()
        return b"".join(struct.pack(f"{order}B{len(r)}{item}", len(r), *r) for r in records)

    def whole(count: int) -> bytes:
        head, data = ["ply", f"format {encoding} 1.0"], b""
        for place, other in enumerate(around):
            if place == 1:
                head.append(f"element vertex {count}")
                head += [
                    f"property {SCALARS[form][len(name) % 2]} {name}" for name, form in columns
                ]
                forms = "".join(form for _, form in columns)
                data += b"".join(body(forms, row) for row in rows)
            if other is not None:
                item, records = other
                head.append(f"element other{place} {len(records)}")
                head.append(f"property list uchar {SCALARS[item][0]} all")
                data += lists(item, records)
        return ("\n".join([*head, "end_header"]) + "\n").encode() + data

    names = [name for name, _ in columns]
    points = np.array([[row[names.index(axis)] for axis in "xyz"] for row in rows], float)
    # What follows the vertices may be read as more of them, and the reverse: then the sizes agree.
    lies = _lying(whole, count) if around == [None, None] else ()
    return Written(whole(count), points, 0, lies)


@st.composite
def pcd(draw: st.DrawFn) -> Written:
    """Fields of any type and count, in any order, three encodings."""
    encoding = draw(st.sampled_from(["ascii", "binary", "binary_compressed"]))
    scalar = st.sampled_from(sorted(SCALARS))
    fields = [(axis, draw(st.sampled_from("fd")), 1) for axis in "xyz"]
    for name in draw(st.lists(st.sampled_from(["rgb", "normal", "_"]), max_size=2, unique=True)):
        fields.append((name, draw(scalar), draw(st.integers(1, 3))))
    fields = draw(st.permutations(fields))
    count = draw(st.integers(1, 5))
    width = sum(n for _, _, n in fields)
    rows = draw(st.lists(st.tuples(*[SMALL] * width), min_size=count, max_size=count))

    def body() -> bytes:
        forms = "".join(f"{n}{form}" for _, form, n in fields)
        if encoding == "ascii":
            return "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
        records = [struct.pack("<" + forms, *row) for row in rows]
        if encoding == "binary":
            return b"".join(records)
        ends = np.cumsum([struct.calcsize(f"<{n}{form}") for _, form, n in fields])
        pieces = [[r[a:b] for r in records] for a, b in zip([0, *ends[:-1]], ends, strict=True)]
        plain = b"".join(b"".join(piece) for piece in pieces)
        runs = [plain[k : k + 32] for k in range(0, len(plain), 32)]
        packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
        return struct.pack("<II", len(packed), len(plain)) + packed

    def whole(count: int) -> bytes:
        types = [SCALARS[form][2] for _, form, _ in fields]
        return (
            f"VERSION 0.7\nFIELDS {' '.join(name for name, _, _ in fields)}\n"
            f"SIZE {' '.join(kind[1] for kind in types)}\nTYPE {' '.join(k[0] for k in types)}\n"
            f"COUNT {' '.join(str(n) for _, _, n in fields)}\nWIDTH {count}\nHEIGHT 1\n"
            f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA {encoding}\n"
        ).encode() + body()

    starts = dict(
        zip([f[0] for f in fields], np.cumsum([0, *[f[2] for f in fields]]), strict=False)
    )
    points = np.array([[row[starts[axis]] for axis in "xyz"] for row in rows], float)
    return Written(whole(count), points, 0, _lying(whole, count))


@st.composite
def ptx(draw: st.DrawFn) -> Written:
    """Rasters with poses; some beams without a return."""
    points, missing, whole, lies = [], 0, "", []
    for number in range(draw(st.integers(1, 3))):
        columns, rows = draw(st.integers(1, 3)), draw(st.integers(1, 3))
        size = columns * rows
        here = draw(st.lists(st.tuples(SMALL, SMALL, SMALL), min_size=size, max_size=size))
        if number == 0:
            here[0] = (1, 2, 3)  # at least one point
        turn = draw(st.permutations(range(3)))
        R = np.eye(3, dtype=int)[turn]
        R[0] *= round(float(np.linalg.det(R)))
        t = np.array(draw(st.tuples(SMALL, SMALL, SMALL)))
        placed = [" ".join(map(str, [*row, 0])) for row in R] + [" ".join(map(str, [*t, 1]))]
        frame = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n" + "\n".join(placed) + "\n"
        body = frame + "".join(f"{x} {y} {z} 0.5\n" for x, y, z in here)
        there = [row for row in here if any(row)]
        points += [np.array(row) @ R + t for row in there]
        missing += size - len(there)
        lies = [lie + f"{columns}\n{rows}\n{body}" for lie in lies]
        lies += [whole + f"{columns + 1}\n{rows}\n{body}", whole + f"{columns}\n{10**8}\n{body}"]
        whole += f"{columns}\n{rows}\n{body}"
    return Written(
        whole.encode(), np.array(points, float), missing, tuple(lie.encode() for lie in lies)
    )


@st.composite
def pts(draw: st.DrawFn) -> Written:
    """Blocks below their counts, with or without intensity and colour."""
    width = draw(st.sampled_from([3, 4, 6, 7]))
    row = st.tuples(*[SMALL] * width)
    blocks = draw(st.lists(st.lists(row, min_size=1, max_size=4), min_size=1, max_size=3))

    def whole(counts: list[int]) -> bytes:
        lines = []
        for count, block in zip(counts, blocks, strict=True):
            lines += [str(count), *(" ".join(map(str, row)) for row in block)]
        return ("\n".join(lines) + "\n").encode()

    counts = [len(block) for block in blocks]
    lies = [whole([*counts[:-1], counts[-1] + lie]) for lie in LIES if counts[-1] + lie > 0]
    points = np.array([row[:3] for block in blocks for row in block], float)
    return Written(whole(counts), points, 0, tuple(lies))


@st.composite
def text(draw: st.DrawFn) -> Written:
    """Rows below a count or none, names or none, any delimiter, decimal mark and end of line."""
    mark, comma = draw(
        st.sampled_from([(" ", 0), (",", 0), (";", 0), (";", 1), ("\t", 1), ("  ", 1)])
    )
    names = draw(st.none() | st.permutations(["x", "y", "z", *draw(st.sampled_from(["", "ab"]))]))
    width = len(names) if names else draw(st.integers(3, 5))
    row = st.tuples(*[SMALL] * width)
    rows = draw(st.lists(row, min_size=1, max_size=5))
    counted = draw(st.booleans())
    lines = [mark.join(f"{value / 8:.3f}" for value in row) for row in rows]
    if comma:
        lines = [line.replace(".", ",") for line in lines]
    for place in draw(st.lists(st.integers(0, len(lines)), max_size=2)):
        lines.insert(place, draw(st.sampled_from(["# a comment", "", "  ", "// another"])))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))

    def whole(count: int) -> bytes:
        head = [str(count)] * counted + ([mark.join(names)] if names else [])
        return end.join([*head, *lines, ""]).encode()

    at = [names.index(axis) for axis in "xyz"] if names else [0, 1, 2]
    points = np.array([[row[k] / 8 for k in at] for row in rows])
    return Written(whole(len(rows)), points, 0, _lying(whole, len(rows)) if counted else ())


PROSE = ["Export of a wheel", "[Data]", "Offset: 1 2 3", "Speed;7 mm/s", "----", "Größe der Wolke"]
NONE = ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND00", "1.#INF", "N/A", "null", "#N/A"]
NAMED = (
    *(("x", "y", "z"), ("X [m]", "Y [m]", "Z [m]"), ("x(m)", "y(m)", "z(m)")),
    *(
        ("Points:0", "Points:1", "Points:2"),
        ("Easting", "Northing", "Elevation"),
        ("X_m", "Y_m", "Z_m"),
    ),
)


@st.composite
def exported(draw: st.DrawFn) -> Written:
    """Text as exporters write it: prose, names, units, labels, quotes, missing values."""
    mark = draw(st.sampled_from([",", ";", "\t"]))
    names = [
        *draw(st.sampled_from(NAMED)),
        *draw(st.sampled_from([(), ("Intensity",), ("a", "b")])),
    ]
    labels, quoted, trailing = (draw(st.booleans()) for _ in range(3))
    names = [*(["Name"] if labels else []), *draw(st.permutations(names))]
    units = draw(st.booleans())
    comment = draw(st.sampled_from(["", "", "#", "//"])) if not units else ""
    above = draw(st.lists(st.sampled_from(PROSE), max_size=3))
    below = draw(st.lists(st.sampled_from(PROSE[:2]), max_size=2))
    count = draw(st.integers(1, 5))
    at = [
        next(k for k, name in enumerate(names) if name in trio) for trio in zip(*NAMED, strict=True)
    ]
    lines, points, missing = [], [], 0
    for number in range(count):
        values = draw(st.tuples(*[SMALL] * len(names)))
        cells = [f"{(value + 0.5) / 8:.4f}" for value in values]
        points.append([float(cells[k]) for k in at])
        if number and draw(st.integers(0, 3)) == 0:
            cells[at[draw(st.integers(0, 2))]] = draw(st.sampled_from([*NONE, ""]))
            points.pop()
            missing += 1
        cells = [f'"{cell}"' if quoted else cell for cell in cells]
        cells[:1] = [f"P{number}"] if labels else cells[:1]
        lines.append(mark.join(cells) + mark * trailing)
    head = [*above, comment + mark.join(names), *([mark.join(["m"] * len(names))] if units else [])]
    end = draw(st.sampled_from(["\n", "\r\n"]))

    def whole(count: int | None) -> bytes:
        counted = [] if count is None else [str(count)]
        return end.join([*head, *counted, *lines, *below, ""]).encode()

    declared = len(lines) if draw(st.booleans()) else None
    lies = _lying(whole, len(lines)) if declared is not None else ()
    return Written(whole(declared), np.array(points, float), missing, lies)


@st.composite
def npy(draw: st.DrawFn) -> Written:
    """Arrays of rows, of rasters, and of records, of any type and order."""
    kind = draw(st.sampled_from(["<f4", ">f8", "<i2", "|u1", ">u4"]))
    shape = draw(st.sampled_from([(1,), (4,), (2, 3), (1, 1)]))
    size = int(np.prod(shape))
    rows = draw(st.lists(st.tuples(SMALL, SMALL, SMALL), min_size=size, max_size=size))
    points = np.array(rows, float)
    if draw(st.booleans()):
        others = draw(st.lists(st.sampled_from(["a", "b"]), max_size=2, unique=True))
        names = draw(st.permutations(["x", "y", "z", *others]))
        types = [draw(st.sampled_from(["S3", "<f8", "u1"])) if n in others else kind for n in names]
        array = np.zeros(shape, list(zip(names, types, strict=True)))
        for axis, name in enumerate("xyz"):
            array[name] = points[:, axis].reshape(shape)
    else:
        columns = draw(st.sampled_from([3, 4, 6]))
        more = np.resize(7.5, (size, columns - 3))
        array = np.column_stack([points + 0.5 * (kind[1] == "f"), more]).reshape(*shape, columns)
        points = points + 0.5 * (kind[1] == "f")
        array = array.astype(kind, order=draw(st.sampled_from("CF")))
    stream = io.BytesIO()
    np.save(stream, array)
    data = stream.getvalue()
    return Written(data, points, 0, (data + b"\0", data[:-1]))


LAS_POINT_BYTES = (20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67)
LAS_HEAD_BYTES = {1: 227, 2: 227, 3: 235, 4: 375}


@st.composite
def las(draw: st.DrawFn) -> Written:
    """Versions 1.1 to 1.4, point formats 0 to 10, records before the points, extra bytes."""
    version = draw(st.sampled_from(sorted(LAS_HEAD_BYTES)))
    form = draw(st.integers(0, 10 if version == 4 else 3))
    length = LAS_POINT_BYTES[form] + draw(st.integers(0, 5))
    records = draw(st.lists(st.binary(max_size=20), max_size=3))
    scale = draw(st.sampled_from([1.0, 0.5, 0.125]))
    shift = draw(st.sampled_from([0.0, 1e5, -4096.5]))
    count = draw(st.integers(1, 5))
    whole_number = st.integers(-(2**31), 2**31 - 1)
    rows = draw(st.lists(st.tuples(*[whole_number] * 3), min_size=count, max_size=count))
    before = b"".join(
        struct.pack("<H16sHH32s", 0, b"made", k, len(held), b"") + held
        for k, held in enumerate(records)
    )

    def whole(count: int) -> bytes:
        size = LAS_HEAD_BYTES[version]
        legacy = count if form < 6 and count < 2**32 else 0
        head = struct.pack(
            "<4sHHIHH8sBB32s32sHHHIIBHI5I",
            *(b"LASF", 0, 0, 0, 0, 0, bytes(8), 1, version, b"made", b"made", 1, 2020),
            *(size, size + len(before), len(records), form, length, legacy, *[0] * 5),
        )
        head += struct.pack("<12d", *[scale] * 3, *[shift] * 3, *[0.0] * 6)
        head += bytes(8) if version > 2 else b""
        head += struct.pack("<QIQ15Q", 0, 0, count, *[0] * 15) if version == 4 else b""
        body = b"".join(struct.pack("<3i", *row).ljust(length, b"\1") for row in rows)
        return head + before + body

    lies = tuple(
        whole(count + lie)
        for lie in LIES
        if count + lie > 0 and (version == 4 or count + lie < 2**32)
    )
    return Written(whole(count), np.array(rows) * scale + shift, 0, lies)


STRATEGIES = {
    **{"ply": ply, "pcd": pcd, "ptx": ptx, "pts": pts, "las": las, "txt": text},
    **{"csv": exported, "npy": npy},
}
