"""Names by which a file would be written elsewhere, or could not be: in buckets, archives, uploads.

All that is copied below a folder gets its path from one function, `path_below`.
"""

from __future__ import annotations

import io
import tarfile
import zipfile
from contextlib import nullcontext
from pathlib import Path

import pytest

from tests.support.batches import five_points, run_process, trees
from wheelplane import files
from wheelplane.batch.storage import remote as store_remote
from wheelplane.errors import InputError, WheelplaneError
from wheelplane.files import improper, open_archive, path_below
from wheelplane.web.files import uploads as page_uploads
from wheelplane.web.files.uploads import Uploads
from wheelplane.web.settings import PageSettings

DATA = b"1 2 3\n"
OUTSIDE = ["/{}/x.xyz", "//{}/x.xyz", "a//{}/x.xyz", "../x.xyz", "a/../../x.xyz", "..", "a/.."]
ODD = ["a//x.xyz", "a/./x.xyz", "a\x00/x.xyz", "a\n.xyz", "\x1b[2J.xyz", "a\x9b.xyz", "n" * 256]
ODD += ["é" * 128 + "/x.xyz"]


def bucket(name: str, folder: Path, request) -> None:
    remote = request.getfixturevalue("remote")
    remote._fs.pipe_file("cars/results/plain", DATA)
    remote._path = lambda _: "cars/results/plain"  # as a bucket whose object has this key
    remote.fetch(name, folder)


def zipped(name: str, folder: Path, _request) -> None:
    info = zipfile.ZipInfo("x")
    info.filename = name  # which ZipInfo would cut at a NUL
    path = folder.with_name("packed")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(info, DATA)
    unpack(path, folder)


def tarred(name: str, folder: Path, _request) -> None:
    info = tarfile.TarInfo(name)
    info.size = len(DATA)
    path = folder.with_name("packed")
    with tarfile.open(path, "w", format=tarfile.PAX_FORMAT) as archive:
        archive.addfile(info, io.BytesIO(DATA))
    unpack(path, folder)


def unpack(path: Path, folder: Path) -> None:
    with open_archive(path, path.name, folder) as archive:
        archive.unpack(folder)


def uploaded(name: str, folder: Path, _request) -> None:
    uploads = Uploads(PageSettings(folders=(), scratch=folder))
    uploads.add(uploads.begin(), name, io.BytesIO(DATA), len(DATA))


WAYS = [bucket, zipped, tarred, uploaded]


def written(place: Path) -> list[Path]:
    return [path for path in place.rglob("*") if path.is_file() and path.name != "packed"]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", [*OUTSIDE, *ODD], ids=repr)
def test_no_name_is_written_elsewhere_or_by_another_name(way, name, tmp_path, request):
    place = tmp_path / "place"
    folder = place / "scratch"
    folder.mkdir(parents=True)
    name = name.format(str(place)[1:])
    cut = way in (zipped, tarred) and "\0" in name  # what is read ends before the NUL
    with nullcontext() if cut else pytest.raises(WheelplaneError) as refused:
        way(name, folder, request)
    assert cut or str(refused.value).isprintable()
    kept = [path.relative_to(folder) for path in written(place)]
    assert kept == ([Path("a")] if cut else [])


@pytest.mark.parametrize("way", WAYS)
def test_every_way_asks_the_same_function(way, tmp_path, request, monkeypatch):
    folder = tmp_path / "scratch"
    folder.mkdir()
    way("a/x.xyz", folder, request)
    (path,) = written(folder)
    assert path.read_bytes() == DATA
    path.unlink()

    def refuse(_folder: Path, name: str, _where: str) -> Path:
        raise InputError(f"asked for {name}")

    for module in (files, store_remote, page_uploads):
        monkeypatch.setattr(module, "path_below", refuse)
    with pytest.raises(WheelplaneError, match=r"asked for a/x\.xyz"):
        way("a/x.xyz", folder, request)
    assert written(folder) == []


def test_a_path_is_below_its_folder_with_its_links_followed(tmp_path):
    folder = tmp_path / "folder"
    (folder / "inner").mkdir(parents=True)
    (folder / "out").symlink_to(tmp_path)
    (folder / "in").symlink_to(folder / "inner")
    (folder / "loop").symlink_to(folder / "loop")
    (tmp_path / "link").symlink_to(folder)
    for name in ("a", "a/b c", "in/a", "..a/b..", "é" * 127, "Citro\udceb.ply"):
        assert path_below(folder, name, "x") == folder / name
        assert path_below(tmp_path / "link", name, "x") == tmp_path / "link" / name
    for name in ("out/a", "out/folder-2/a", "loop/a"):
        assert improper(name) is None
        with pytest.raises(InputError, match=r"x: the name .* leads out of its folder: rename it"):
            path_below(folder, name, "x")


def test_an_archive_may_begin_its_names_with_a_dot(tmp_path):
    for way in (zipped, tarred):
        folder = tmp_path / way.__name__
        folder.mkdir()
        way("./a/x.xyz", folder, None)
        assert (folder / "a" / "x.xyz").read_bytes() == DATA


KEYS = {
    "//tmp/t1/x.txt": "is absolute",
    "/x.txt": "is absolute",
    "t1//tmp/x.txt": "has an empty part",
    "t1/../x.txt": "by a part '..'",
    "../results/x.txt": "by a part '..'",
    "./x.txt": "has a part '.'",
    "t1/./x.txt": "has a part '.'",
    "t1/\x1b[2J.txt": "has a control character",
    "t1/a\x7fb.txt": "has a control character",
    "n" * 256 + ".txt": "has a part of 260 bytes, 255 at most",
    "car//rr.ply": "has an empty part",
    "car/../rl.ply": "by a part '..'",
}


@pytest.mark.slow
def test_a_key_that_is_no_name_of_a_file_is_a_row_that_says_why(remote, tmp_path):
    data = five_points(tmp_path / "a.txt", 1).read_bytes()
    files = dict.fromkeys(KEYS, data) | {"good.txt": data, "car/capture.toml": b"x"}
    # a key that is also a folder of another: no file system holds both
    files |= {"both/rr.xyz": DATA, "both/rr.xyz/fl.xyz": DATA, "t1/../photo.jpg": DATA}
    bucket, client = "cars", remote._fs
    for key, content in files.items():
        client.call_s3("put_object", Bucket=bucket, Key=f"archive/{key}", Body=content)
    before = set(tmp_path.parent.rglob("*"))
    done = run_process("s3://cars/archive", tmp_path / "results", "--workers", "1")
    assert done.returncode == 1, done.stderr
    found = {name: tree["batch"] for name, tree in trees(tmp_path / "results").items()}
    assert set(found) == {*KEYS, "good.txt", "car", "both"}
    assert found["good.txt"]["status"] == "ok"
    for key, why in KEYS.items():
        row = found[key]
        assert (row["status"], row["stage"]) == ("failed", "discover"), key
        assert why in row["reason"]
        assert row["reason"].startswith(" ".join(key[:200].split()))
    assert found["car"]["reason"].startswith("car: ")  # of its own files alone
    assert found["both"]["reason"] == (
        "its files cannot be read from the archive: both/rr.xyz/fl.xyz: "
        "a folder of its name is an object too: rename one of them"
    )
    assert "skipped, not captures: 1 .jpg" in done.stdout
    assert "\x1b" not in done.stdout + done.stderr
    outside = set(tmp_path.parent.rglob("*")) - before - set(tmp_path.rglob("*"))
    assert outside == set()
    again = run_process("s3://cars/archive", tmp_path / "results", "--workers", "1")
    assert f"{len(found) - 1} done before, 1 to do" in again.stderr  # what cannot be read
