"""Scans that are compressed or stand in an archive: the same points, and no harm done."""

from __future__ import annotations

import gzip
import io
import random
import tarfile
import tempfile
import zipfile

import numpy as np
import pytest

from wheelplane.errors import InputError
from wheelplane.files import inflate, open_archive
from wheelplane.readers import read_scan

TEXT = "".join(f"{x}.25 {x}.5 {x}.75 {x}\n" for x in range(200)).encode()


@pytest.fixture(autouse=True)
def scratch(tmp_path, monkeypatch):
    """Temporary files go to a folder of the test's own, and none is left there."""
    folder = tmp_path / "scratch"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


def write_zip(path, files, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def write_tar(path, files, mode="w:gz"):
    with tarfile.open(path, mode) as archive:
        for name, data in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    return path


def refusal(path):
    with pytest.raises(InputError) as caught:
        read_scan(path, name=path.name)
    text = str(caught.value)
    assert text.startswith(f"{path.name}: ")
    assert len(text.splitlines()) == 1
    assert text.isprintable()
    assert len(text) < 500
    return text


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("a.zip", {"rr.xyz": TEXT}),
        ("a.ZIP", {"deep/er/rr.XYZ": TEXT, "deep/photo.jpg": b"x", "notes.pdf": b"y"}),
        ("a.zip", {"rr.xyz.gz": gzip.compress(TEXT), "__MACOSX/._rr.xyz": b"x", ".rr.xyz": b"x"}),
        ("a.tar", {"rr.xyz": TEXT}),
        ("a.tgz", {"./rr.xyz": TEXT}),
        ("a.tar.gz", {"in/rr.xyz.gz": gzip.compress(TEXT)}),
    ],
)
def test_the_only_scan_of_an_archive_is_read(tmp_path, name, files):
    path = tmp_path / name
    write_zip(path, files) if name.lower().endswith("zip") else write_tar(
        path, files, "w" if name.endswith("tar") else "w:gz"
    )
    (tmp_path / "rr.xyz").write_bytes(TEXT)
    plain, packed = read_scan(tmp_path / "rr.xyz"), read_scan(path)
    assert packed.points_m.tobytes() == plain.points_m.tobytes()
    assert packed.intensity.tobytes() == plain.intensity.tobytes()
    assert packed.source.startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({"a.xyz": TEXT, "b.ply": TEXT}, "it holds 2 scans (a.xyz, b.ply), one is needed"),
        ({"notes.pdf": b"x"}, "it holds no scan, one is needed"),
        ({}, "it holds no scan"),
        ({"inner.zip": b"PK"}, "it holds no scan"),
        ({"a.xyz": b""}, "the file is empty"),
        ({"a.xyz": b"1 2 x\n"}, "a.zip: a.xyz: line 1 holds 'x'"),
        ({"a.ply": TEXT}, "a.zip: a.ply: the suffix is '.ply', but"),
        ({"a.xyz.gz": TEXT}, "is not compressed"),
        ({"a.xyz.gz": gzip.compress(gzip.compress(TEXT))}, "looks like a gzip file|binary"),
        ({"../a.xyz": TEXT}, "points outside"),
        ({"/etc/a.xyz": TEXT}, "points outside"),
        ({"..\\a.xyz": TEXT}, "points outside"),
    ],
)
def test_an_archive_that_is_refused(tmp_path, files, says):
    text = refusal(write_zip(tmp_path / "a.zip", files))
    assert any(part in text for part in says.split("|"))


@pytest.mark.parametrize("suffix", [".gz", ".bz2", ".xz"])
def test_what_is_not_compressed_or_not_a_scan_below(tmp_path, suffix):
    path = tmp_path / f"rr.xyz{suffix}"
    path.write_bytes(TEXT)
    assert "not compressed" in refusal(path)
    path.write_bytes(b"")
    assert "not compressed" in refusal(path)
    other = tmp_path / f"photo.jpg{suffix}"
    other.write_bytes(gzip.compress(b"x"))
    assert "'.jpg' is not of a known point cloud format" in refusal(other)


@pytest.mark.parametrize("kind", ["gz", "zip", "tgz", "tar"])
def test_damage_is_refused_or_harmless(tmp_path, kind):
    """A tar has no check of its contents, so there only the number of points is certain."""
    path = tmp_path / f"rr.xyz.{kind}"
    if kind == "gz":
        path.write_bytes(gzip.compress(TEXT))
    elif kind == "zip":
        write_zip(path, {"rr.xyz": TEXT})
    else:
        write_tar(path, {"rr.xyz": TEXT}, "w" if kind == "tar" else "w:gz")
    data = path.read_bytes()
    whole = read_scan(path).points_m
    rng = random.Random(kind)
    for _ in range(300):
        broken = bytearray(data)
        broken[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(broken[: rng.choice([len(data), rng.randrange(1, len(data))])])
        try:
            found = read_scan(path, name=path.name).points_m
        except InputError:
            refusal(path)
        else:
            assert kind == "tar" or found.tobytes() == whole.tobytes()


def test_bombs_are_refused_at_the_limit(tmp_path, monkeypatch, scratch):
    monkeypatch.setattr("wheelplane.files.FREE_BYTES", 1 << 20)
    nought = bytes(20 << 20)  # packs to a thousandth
    bomb = tmp_path / "rr.xyz.gz"
    bomb.write_bytes(gzip.compress(nought))
    assert "unpacks to more than 0.00" in refusal(bomb)
    assert "unpacks to" in refusal(write_zip(tmp_path / "a.zip", {"rr.xyz": nought}))
    assert "unpacks to more than" in refusal(write_tar(tmp_path / "a.tgz", {"rr.xyz": nought}))
    written = tmp_path / "plain"
    with pytest.raises(InputError, match="unpacks to more"):
        inflate(bomb, written, "rr.xyz.gz")
    ratio = written.stat().st_size / bomb.stat().st_size
    assert ratio <= max(200, (1 << 20) / bomb.stat().st_size)


PLY = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n"


@pytest.mark.parametrize(("suffix", "head"), [("xyz", b""), ("csv", TEXT), ("ply", PLY)])
def test_a_line_longer_than_any_row_ends_the_unpacking(tmp_path, suffix, head):
    """The end of the file is cut off: who reads so far reports that, and not the line."""
    packed = tmp_path / f"rr.{suffix}.gz"
    digits = random.Random(0).randbytes(4 << 20).hex().encode()
    packed.write_bytes(gzip.compress(head + digits)[:-20])
    assert "a line is longer than 1048576 characters" in refusal(packed)


def test_binary_data_has_no_lines(tmp_path):
    points = np.full((100_000, 3), 1.5)
    points[:, 0] = np.arange(1.0, 2.0, 1e-5)
    data = io.BytesIO()
    np.save(data, points)
    packed = tmp_path / "rr.npy.gz"
    packed.write_bytes(gzip.compress(data.getvalue()))
    assert len(read_scan(packed).points_m) == len(points)


def test_a_bomb_in_a_member_that_is_not_read_is_refused_too(tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.files.FREE_BYTES", 1 << 20)
    assert "unpacks to" in refusal(
        write_zip(tmp_path / "a.zip", {"rr.xyz": TEXT, "x.bin": bytes(20 << 20)})
    )


def test_too_many_members_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.files.MAX_MEMBERS", 10)
    files = {f"{n}.jpg": b"" for n in range(11)}
    assert "holds 11 files, 10 at most" in refusal(write_zip(tmp_path / "a.zip", files))


def test_a_zip_that_lies_about_a_size_is_refused(tmp_path):
    path = write_zip(tmp_path / "a.zip", {"rr.xyz": TEXT})
    size = len(TEXT).to_bytes(4, "little")
    path.write_bytes(path.read_bytes().replace(size, (100).to_bytes(4, "little")))
    assert "cannot be unpacked" in refusal(path)


def test_only_what_is_asked_for_is_written(tmp_path, scratch):
    path = write_zip(tmp_path / "a.zip", {"rr.xyz": TEXT, "b/c.bin": b"x", "d.bin": b"y"})
    out = tmp_path / "out"
    with open_archive(path, "a.zip", scratch) as archive:
        assert {(m.name, m.size) for m in archive.members} == {
            ("rr.xyz", len(TEXT)), ("b/c.bin", 1), ("d.bin", 1)
        }  # fmt: skip
        archive.unpack(out, archive.members[1:2])
    assert [p.relative_to(out).as_posix() for p in sorted(out.rglob("*"))] == ["b", "b/c.bin"]


NPZ = {
    "points": np.arange(12.0).reshape(4, 3),
    "intensity": np.array([1, 2, 3, 40000], np.uint16),
}


def write_npz(path, **arrays):
    np.savez_compressed(path, **arrays)
    return path


@pytest.mark.parametrize("name", ["points", "xyz", "anything"])
@pytest.mark.parametrize("order", "CF")
def test_npz_by_name_or_alone(tmp_path, name, order):
    points = np.asarray(NPZ["points"], order=order)
    scan = read_scan(
        write_npz(tmp_path / "rr.npz", **{name: points, "intensity": NPZ["intensity"]})
    )
    assert scan.points_m.tolist() == NPZ["points"].tolist()
    assert scan.intensity.tolist() == [1, 2, 3, 40000]
    alone = read_scan(write_npz(tmp_path / "rr.npz", **{name: np.hstack([points, points[:, :1]])}))
    assert alone.intensity.tolist() == [0, 3, 6, 9]


@pytest.mark.parametrize(
    ("arrays", "says"),
    [
        ({"a": NPZ["points"], "b": NPZ["points"]}, "its arrays are a, b"),
        ({"points": NPZ["points"], "xyz": NPZ["points"]}, "its arrays are points, xyz"),
        ({"intensity": NPZ["intensity"]}, "its arrays are none"),
        ({"points": NPZ["points"][:3], "intensity": NPZ["intensity"]}, "(4,), the points are 3"),
        ({"points": np.ones((4, 4)), "intensity": NPZ["intensity"]}, "an intensity twice"),
        ({"points": NPZ["points"].ravel()}, "the array has the shape"),
        ({"points": np.array([None] * 3)}, "type '|O'"),
        ({"points": np.empty((0, 3)), "intensity": np.empty(0)}, "0 points"),
    ],
)  # fmt: skip
def test_npz_that_is_refused(tmp_path, arrays, says):
    assert says in refusal(write_npz(tmp_path / "rr.npz", **arrays))


def test_binary_data_that_happen_to_be_letters_are_no_text(tmp_path):
    """Three pieces of an array, the last two of which hold neither a zero nor a line end."""
    count = 3 * (1 << 20) // 24
    rows = np.frombuffer(b"A" * 24 * count).reshape(count, 3).copy()
    rows[0] = [1.0, 2.0, 3.0]
    stream = io.BytesIO()
    np.save(stream, rows)
    (tmp_path / "a.npy.gz").write_bytes(gzip.compress(stream.getvalue()))
    assert read_scan(tmp_path / "a.npy.gz").invalid_points + len(
        read_scan(tmp_path / "a.npy.gz").points_m
    ) == len(rows)
