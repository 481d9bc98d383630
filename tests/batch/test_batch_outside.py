"""A batch reads no file outside its archive, whatever a capture names or links to.

Captures come from others, and results go to others: what the runner may read is not theirs to see.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.support.batches import archive_of, five_points, run, settle, trees
from tests.support.made import write_small_capture
from wheelplane.batch.run.watch import is_complete
from wheelplane.batch.storage.entry import OUTSIDE
from wheelplane.batch.storage.local import LocalStore
from wheelplane.capture import open_capture
from wheelplane.errors import InputError
from wheelplane.files import lies_in, sha256

SECRET = "secret-4711"
WHEELS = ("RR", "RL", "FR", "FL")


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    """Four coarse scans of wheels, and no capture.toml."""
    folder = write_small_capture(tmp_path_factory.mktemp("scans") / "capture", trials=0)
    for path in folder.iterdir():
        if path.suffix != ".ply":
            path.unlink()
    return folder


@pytest.fixture
def place(tmp_path):
    """A folder with an archive, and beside it what the archive must not reach."""
    outside = tmp_path / "outside"
    outside.mkdir()
    for name in ("rr.xyz", "plain.txt", "target.toml", "scanner.toml", "capture.toml"):
        (outside / name).write_text(f"{SECRET} = 'and {SECRET}'\n" * 3)
    (tmp_path / "archive").mkdir()
    return tmp_path


def write_capture(folder: Path, scans: Path, more: str = "", **files: str) -> Path:
    """A folder capture with these scans, but for the files given by wheel."""
    shutil.copytree(scans, folder)
    named = {wheel: files.get(wheel, f"{wheel.lower()}.ply") for wheel in WHEELS}
    lines = [f'{wheel} = "{file}"' for wheel, file in named.items()]
    text = more if "target" in more.partition("[")[0] else f'target = "disc-250"\n{more}'
    head, table, tail = text.partition("[[")
    (folder / "capture.toml").write_text(
        head + "\n[reference]\n" + "\n".join(lines) + "\n" + table + tail
    )
    return folder


def refused(place: Path, named: str, capture: str = "car") -> None:
    """The batch's only row says what is named and that it lies outside; nothing of it is shown."""
    for folder in ("archive", "outside"):
        settle(place / folder)
    done = run(place / "archive", place / "results", "--workers", "1")
    assert done.returncode == 1, done.stderr
    (tree,) = trees(place / "results").values()
    assert tree["batch"]["status"] == "failed"
    reason = tree["batch"]["reason"]
    assert reason.startswith(f"{capture}: ")
    assert f"{named!r} lies outside the archive: copy the file into it" in reason
    assert "Traceback" not in done.stdout + done.stderr
    hashes = set(tree["provenance"]["inputs"].values())
    assert not hashes & {sha256(other) for other in (place / "outside").glob("*.*")}
    for path in filter(Path.is_file, (place / "results").rglob("*")):
        assert SECRET.encode() not in path.read_bytes(), path
    assert SECRET not in done.stdout + done.stderr
    again = run(place / "archive", place / "results", "--workers", "1")
    assert "1 done before, 0 to do" in again.stderr


@pytest.mark.parametrize("form", ["absolute", "up", "far up", "by a folder", "through a link"])
def test_a_scan_elsewhere(place, scans, form):
    file = {
        "absolute": f"{place}/outside/rr.xyz",
        "up": "../../outside/rr.xyz",
        "far up": f"{'../' * 30}{place}/outside/rr.xyz",
        "by a folder": "sub/../../../outside/rr.xyz",
        "through a link": "linked/rr.xyz",
    }[form]
    folder = write_capture(place / "archive" / "car", scans, RR=file)
    (folder / "sub").mkdir()
    if form == "through a link":
        (folder / "linked").symlink_to(place / "outside")
    refused(place, file)


def test_a_scan_that_is_a_link(place, scans):
    folder = write_capture(place / "archive" / "car", scans, RR="rr.xyz")
    (folder / "rr.ply").unlink()
    (folder / "rr.xyz").symlink_to(place / "outside" / "rr.xyz")
    refused(place, "rr.xyz")


def test_a_scan_by_its_name_that_is_a_link_of_a_link(place, scans):
    folder = shutil.copytree(scans, place / "archive" / "car")
    (folder / "rr.ply").unlink()
    (folder / "other").symlink_to(place / "outside" / "rr.xyz")
    (folder / "rr.xyz").symlink_to("other")
    (folder / "capture.toml").write_text('target = "disc-250"\n')
    refused(place, "rr.xyz")


MORE = {"trial": "", "sweep": 'wheel = "FL"\n', "runout": 'wheel = "FL"\nangle_deg = 0\n'}


@pytest.mark.parametrize("table", MORE)
def test_a_further_scan(place, scans, table):
    file = "../../outside/rr.xyz"
    one = f'[[{table}]]\nname = "1"\nfile = "{file}"\n{MORE[table]}'
    other = f'[[{table}]]\nname = "2"\nfile = "fl.ply"\n{MORE[table]}' if table == "runout" else ""
    write_capture(place / "archive" / "car", scans, one + other)
    refused(place, file)


@pytest.mark.parametrize("key", ["target", "scanner"])
@pytest.mark.parametrize("form", ["path", "link"])
def test_the_file_of_the_target_or_the_scanner(place, scans, key, form):
    file = f"{key}.toml" if form == "link" else f"../../outside/{key}.toml"
    folder = write_capture(place / "archive" / "car", scans, f'{key} = "{file}"\n')
    if form == "link":
        (folder / file).symlink_to(place / "outside" / file)
    refused(place, file)


def test_the_cloud_of_a_vehicle(place):
    folder = place / "archive" / "car"
    folder.mkdir()
    file = "../../outside/rr.xyz"
    (folder / "capture.toml").write_text(f'cloud = "{file}"\ntarget = "disc-250"\n')
    refused(place, file)


@pytest.mark.parametrize("name", ["capture.toml", "Capture.TOML"])
def test_the_capture_file_itself(place, scans, name):
    folder = shutil.copytree(scans, place / "archive" / "car")
    (folder / name).symlink_to(place / "outside" / "capture.toml")
    refused(place, name)


@pytest.mark.parametrize("name", ["car.txt", "car.xyz", "car.zip", "car.tar.gz", "car.csv"])
def test_a_capture_of_one_file_that_is_a_link(place, name):
    (place / "archive" / name).symlink_to(place / "outside" / "plain.txt")
    refused(place, name, name)


def test_a_folder_that_is_a_link(place, scans):
    """It is one row, and nothing behind it is listed."""
    write_capture(place / "outside" / "car", scans)
    (place / "archive" / "all").symlink_to(place / "outside")
    refused(place, "all", "all")


def test_a_link_to_everything_is_not_walked(place):
    for name in ("root", "proc"):
        (place / "archive" / name).symlink_to("/" if name == "root" else "/proc")
    store = LocalStore(place / "archive", confined=True)
    assert [(entry.name, entry.stamp) for entry in store.list()] == [
        ("proc", OUTSIDE),
        ("root", OUTSIDE),
    ]


def test_links_within_the_archive_are_followed_and_its_root_may_be_one(place, scans):
    archive = place / "archive"
    shutil.move(write_capture(archive / "store" / "car", scans), archive / "store" / "moved")
    (archive / "store" / "ours.toml").write_text('shape = "disc"\ndiameter = 0.25\n')
    text = (archive / "store" / "moved" / "capture.toml").read_text()
    (archive / "store" / "moved" / "capture.toml").write_text(
        text.replace("disc-250", "../ours.toml")
    )
    (archive / "2026").symlink_to(archive / "store")
    five_points(archive / "a.txt", 1)
    (archive / "b.txt").symlink_to("a.txt")
    (place / "by-link").symlink_to(archive)
    settle(archive)
    done = run(place / "by-link", place / "results", "--workers", "1")
    assert done.returncode == 0, done.stdout + done.stderr
    assert sorted(trees(place / "results")) == ["2026/moved", "a.txt", "b.txt", "store/moved"]


def test_a_folder_of_results_may_be_a_link(place):
    archive_of(place / "archive", 2)
    (place / "disk").mkdir()
    (place / "results").mkdir()
    (place / "results" / "measurements").symlink_to(place / "disk")
    for known in (0, 2):
        done = run(place / "archive", place / "results", "--workers", "1")
        assert f"{known} done before, {2 - known} to do" in done.stderr


def test_one_s_own_capture_may_name_files_anywhere(place, scans):
    """`measure` is called by who can read them anyway."""
    shutil.copy(scans / "rr.ply", place / "outside" / "rr.ply")
    folder = write_capture(place / "car", scans, RR=f"{place}/outside/rr.ply")
    with open_capture(folder) as capture:
        assert capture.entries[0].path.samefile(place / "outside" / "rr.ply")
    with pytest.raises(InputError, match="lies outside"), open_capture(folder, within=folder):
        pass
    with open_capture(folder, within=place) as capture:
        assert len(capture.entries) == len(WHEELS)


def test_a_watched_folder_reads_nothing_elsewhere_to_see_whether_a_capture_is_complete(
    place, scans
):
    from wheelplane.batch.plan.discover import FoundCapture

    write_capture(place / "archive" / "car", scans)
    found = FoundCapture("car", "folder", ())
    assert is_complete(found, place / "archive")
    (place / "archive" / "car" / "capture.toml").unlink()
    (place / "archive" / "car" / "capture.toml").symlink_to("/dev/zero")
    assert not is_complete(found, place / "archive")


def test_what_lies_in_a_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "loop").symlink_to(inside / "loop")
    (inside / "up").symlink_to("..")
    (tmp_path / "link").symlink_to(inside)
    for name in (".", "a", "a/../b", "up/inside/a", f"{inside}/a"):
        assert lies_in(inside / name, inside), name
        assert lies_in(inside / name, tmp_path / "link"), name
    for name in ("..", "up", "up/a", "a/../../b", "/", "/etc", "a\0", "../inside-2"):
        assert not lies_in(inside / name, inside), name
