"""Files written whole, once and durably, in a folder and in object storage."""

from __future__ import annotations

import errno
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from wheelplane.batch.storage import local as store_local
from wheelplane.batch.storage import remote as store_remote
from wheelplane.batch.storage.entry import DENIED, MOST_LEVELS, PARTIAL, TOO_DEEP
from wheelplane.batch.storage.store import open_store
from wheelplane.errors import InputError, MissingDependencyError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(params=["folder", "objects"])
def store(request, tmp_path):
    """Each kind of store, empty."""
    if request.param == "folder":
        return open_store(str(tmp_path / "results"))
    return request.getfixturevalue("remote")


def names(store, prefix=""):
    return [entry.name for entry in store.list(prefix)]


def test_what_is_written_is_read_listed_and_fetched(store, tmp_path):
    assert names(store) == []
    content = {"b.json": b"1", "a/x.json": b"22", "a.json": b"", "a/b/c d+é%41.json": b"\0" * 3000}
    for name, data in content.items():
        assert not store.exists(name)
        assert store.write_new(name, data)
        assert store.exists(name)
    entries = list(store.list())
    assert [entry.name for entry in entries] == sorted(content)
    assert {entry.name: entry.size for entry in entries} == {n: len(d) for n, d in content.items()}
    assert names(store, "a/") == sorted(n for n in content if n.startswith("a/"))
    assert names(store, "a") == sorted(n for n in content if n.startswith("a"))
    assert names(store, "none") == []
    for prefix in ("", "a", "a/", "none"):
        assert list(store.names(prefix)) == names(store, prefix)
    for name, data in content.items():
        assert store.read(name) == data
        assert store.fetch(name, tmp_path / "copies").read_bytes() == data
    store.remove("b.json")
    store.remove("b.json")
    assert names(store) == sorted(set(content) - {"b.json"})


def test_write_new_never_replaces_and_write_does(store):
    assert store.write_new("a/x.json", b"first")
    before = next(iter(store.list())).stamp
    assert not store.write_new("a/x.json", b"second")
    assert store.read("a/x.json") == b"first"
    assert next(iter(store.list())).stamp == before
    store.write("a/x.json", b"third")
    assert store.read("a/x.json") == b"third"
    assert next(iter(store.list())).stamp != before
    assert store.exclusive


def test_a_file_is_sent_where_it_is_still_the_one_that_was_seen(store, tmp_path):
    (tmp_path / "one").write_bytes(b"1")
    (tmp_path / "other").write_bytes(b"22")
    assert store.send("a/b", tmp_path / "one", None)
    seen = store.stat("a/b").stamp
    assert not store.send("a/b", tmp_path / "other", None)
    assert not store.send("a/b", tmp_path / "other", "0" * 32)
    assert not store.send("none", tmp_path / "other", seen)
    assert (store.read("a/b"), store.exists("none")) == (b"1", False)
    assert store.send("a/b", tmp_path / "other", seen)
    assert not store.send("a/b", tmp_path / "one", seen)
    assert store.read("a/b") == b"22"


def test_what_is_not_there_is_reported_in_one_line(store, tmp_path):
    for ask in (store.read, lambda name: store.fetch(name, tmp_path / "copies")):
        with pytest.raises(InputError, match=r"none\.json.*[Nn]o such"):
            ask("none.json")
    assert not (tmp_path / "copies" / "none.json").exists()


RACER = """
import sys, time
from wheelplane.batch.storage.store import open_store
store = open_store(sys.argv[1])
print("ready", flush=True)
start = float(sys.stdin.readline())
won = []
for i in range(300):
    while time.time() < start + 0.004 * i:
        pass  # so that all come to each name at once
    if store.write_new(f"{i % 7}/{i}", sys.argv[2].encode() * 20000):
        won.append(str(i))
print(",".join(won))
"""


def race(url: str) -> list[set[str]]:
    """What each of four processes, started at once, could write as the first."""
    racers = [
        subprocess.Popen(
            [sys.executable, "-c", RACER, url, letter],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for letter in "abcd"
    ]
    for racer in racers:
        assert racer.stdout.readline() == "ready\n"
    start = time.time() + 0.1
    for racer in racers:
        racer.stdin.write(f"{start}\n")
        racer.stdin.flush()
    return [set(filter(None, racer.communicate()[0].strip().split(","))) for racer in racers]


def test_of_racing_processes_exactly_one_writes_a_file(tmp_path):
    won = race(str(tmp_path))
    assert sorted(name for mine in won for name in mine) == sorted(map(str, range(300)))
    assert sum(map(bool, won)) > 1  # so there was a race
    for letter, mine in zip("abcd", won, strict=True):
        for name in mine:
            assert (tmp_path / f"{int(name) % 7}" / name).read_bytes() == letter.encode() * 20000
    assert list((tmp_path / PARTIAL).iterdir()) == []


def test_without_hard_links_still_only_one_writes(tmp_path, monkeypatch):
    def no_links(*_: object) -> None:
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", no_links)
    store = open_store(str(tmp_path))
    assert store.write_new("a", b"1")
    assert not store.write_new("a", b"2")
    assert store.read("a") == b"1"
    assert names(store) == ["a"]


KILLED = """
import os, signal, sys
from wheelplane.batch.storage.store import open_store
os.link = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
open_store(sys.argv[1]).write_new("measurements/ab/abc.json", b"{}")
"""


def test_what_a_killed_process_left_is_no_result_and_goes_in_time(tmp_path):
    run = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=ROOT, check=False)
    assert run.returncode == -signal.SIGKILL
    (left,) = (tmp_path / PARTIAL).iterdir()
    assert names(open_store(str(tmp_path))) == []
    assert open_store(str(tmp_path)).write_new("a", b"1")
    assert left.exists()  # it could be another process's, at work
    old = time.time() - store_local.STALE_S - 60
    os.utime(left, (old, old))
    assert open_store(str(tmp_path)).write_new("b", b"1")
    assert not left.exists()
    assert names(open_store(str(tmp_path))) == ["a", "b"]


def test_a_write_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    store = open_store(str(tmp_path))
    with pytest.raises(InputError, match=r"a\.json: cannot be written \(No space left.*make room"):
        store.write_new("a.json", b"1")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_disk_that_becomes_read_only_is_one_line(tmp_path, monkeypatch):
    def read_only(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    store = open_store(str(tmp_path))
    monkeypatch.setattr(os, "fsync", read_only)
    monkeypatch.setattr(Path, "unlink", read_only)
    with pytest.raises(
        InputError, match=r"a\.json: cannot be written \(Read-only.*writable folder"
    ):
        store.write_new("a.json", b"1")


def test_content_and_name_are_synced_before_a_write_returns(tmp_path, monkeypatch):
    synced = []
    real = os.fsync
    monkeypatch.setattr(
        os,
        "fsync",
        lambda fd: synced.append(str(Path(f"/proc/self/fd/{fd}").readlink())) or real(fd),
    )
    open_store(str(tmp_path)).write_new("m/ab/x.json", b"1")
    content = [i for i, path in enumerate(synced) if f"/{PARTIAL}/" in path]
    assert len(content) == 1
    assert synced[-1] == str(tmp_path / "m" / "ab")
    assert {str(tmp_path), str(tmp_path / "m")} <= set(synced)
    assert content[0] < len(synced) - 1


def test_a_folder_with_odd_links_is_listed_once(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x").write_bytes(b"1")
    (tmp_path / "a" / "up").symlink_to(tmp_path)
    (tmp_path / "b").symlink_to(tmp_path / "a")
    broken = {"gone": "nowhere", "itself": "itself", "one": "other", "other": "one", "of": "a/x/y"}
    for name, target in broken.items():
        (tmp_path / name).symlink_to(tmp_path / target)
    for confined in (False, True):
        entries = {entry.name: entry for entry in open_store(str(tmp_path), confined).list()}
        assert sorted(entries) == sorted(["a/x", "b/x", *broken])
        assert {entries[name].stamp for name in broken} == {"broken link"}


def test_a_fan_of_links_is_listed_as_often_as_it_has_folders(tmp_path):
    """Two links in each of thirty folders lead to the next: 2^29 paths to the last."""
    depth = 30
    for k in range(depth):
        (tmp_path / f"{k:02d}").mkdir()
        (tmp_path / f"{k:02d}" / "file").write_bytes(b"1")
    for k in range(depth - 1):
        for name in "xy":
            (tmp_path / f"{k:02d}" / name).symlink_to(f"../{k + 1:02d}")
    found = names(open_store(str(tmp_path)))
    assert len(found) == 2 * depth - 1
    assert {f"{k:02d}/file" for k in range(depth)} <= set(found)
    assert found == sorted(found)


def test_folders_in_folders_without_end_are_one_entry(tmp_path):
    (tmp_path / "file").write_bytes(b"1")
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        for _ in range(5000):
            Path("d").mkdir()
            os.chdir("d")
        Path("file").write_bytes(b"1")
        entries = list(open_store(str(tmp_path)).list())
    finally:
        os.chdir(here)
        subprocess.run(["rm", "-rf", str(tmp_path / "d")], check=True)
    deep, file = sorted(entries, key=lambda entry: entry.stamp == TOO_DEEP, reverse=True)
    assert (deep.stamp, file.name) == (TOO_DEEP, "file")
    assert deep.name == "/".join("d" * (MOST_LEVELS + 1))


@pytest.mark.parametrize("lists", [False, True])
def test_a_folder_without_permission_is_an_entry_of_an_archive_alone(tmp_path, monkeypatch, lists):
    """Neither root nor Windows is refused by the modes of files: the answers are replaced."""
    for name in ("a/1", "b/closed/2", "c/3"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_bytes(b"1")
    scandir, access = os.scandir, os.access

    def refused(path) -> bool:
        return str(path).endswith("closed")

    def scan(path):
        if refused(path) and not lists:
            raise PermissionError(errno.EACCES, "Permission denied")
        return scandir(path)

    monkeypatch.setattr(os, "scandir", scan)
    monkeypatch.setattr(os, "access", lambda p, mode: not refused(p) and access(p, mode))
    entries = list(open_store(str(tmp_path), confined=True).list())
    assert [entry.name for entry in entries] == ["a/1", "b/closed", "c/3"]
    assert [entry.stamp == DENIED for entry in entries] == [False, True, False]
    for store in (open_store(str(tmp_path)), open_store(str(tmp_path / "b/closed"), confined=True)):
        with pytest.raises(InputError, match=r"closed.*cannot be listed \(Permission denied\)"):
            list(store.list())


@pytest.mark.parametrize("levels", [10, 60])
def test_a_path_that_is_too_long_is_an_entry_and_ends_no_listing(tmp_path, levels):
    """Levels of 250 bytes, of which the system takes some fifteen in one path."""
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        for _ in range(levels):
            Path("d" * 250).mkdir()
            os.chdir("d" * 250)
            Path("e" * 250).write_bytes(b"1")
        entries = list(open_store(str(tmp_path)).list())
    finally:
        os.chdir(here)
        subprocess.run(["rm", "-rf", str(tmp_path / ("d" * 250))], check=True)
    assert len(entries) == min(levels, len(entries))
    assert any(entry.stamp == TOO_DEEP for entry in entries) == (levels == 60)


@pytest.mark.parametrize(
    ("url", "error", "text"),
    [
        ("s3://no-such-bucket/x", InputError, "no such bucket"),
        ("quux://a/b", InputError, "quux:// is unknown"),
        ("az://a/b", MissingDependencyError, "pip install 'adlfs'"),
        ("file://elsewhere/a", InputError, "host elsewhere"),
    ],
)
def test_a_url_that_leads_nowhere_is_reported_in_one_line(url, error, text, remote):
    with pytest.raises(error, match=text) as caught:
        open_store(url)
    assert "\n" not in str(caught.value)


def test_a_server_that_does_not_answer_is_reported_in_one_line(remote, monkeypatch):
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    with pytest.raises(InputError, match=r"after 3 tries.*address, credentials"):
        open_store("s3://cars/results")


class Refusing(BaseHTTPRequestHandler):
    """S3 that refuses every request, with the status and the code in the server's `answer`."""

    protocol_version = "HTTP/1.1"

    def refuse(self) -> None:
        self.server.asked += 1
        status, code, *to = self.server.answer
        body = f"<Error><Code>{code}</Code><Message>why</Message></Error>".encode() * bool(code)
        self.send_response(status)
        for address in to:
            self.send_header("Location", address)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    do_GET = do_HEAD = refuse  # noqa: N815

    def log_message(self, *_: object) -> None:
        """Keep quiet."""


@pytest.fixture(scope="module")
def refusing():
    server = ThreadingHTTPServer(("127.0.0.1", 0), Refusing)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.mark.parametrize(
    ("status", "code", "text"),
    [
        (403, "SignatureDoesNotMatch", "SignatureDoesNotMatch: why"),
        (403, "RequestTimeTooSkewed", "RequestTimeTooSkewed: why"),
        (403, "InvalidAccessKeyId", "InvalidAccessKeyId: why"),
        (400, "ExpiredToken", "ExpiredToken: why"),
        (400, "InvalidToken", "InvalidToken: .*why"),
        (404, "NoSuchBucket", "no such bucket"),
        (404, "", "check the address of the storage"),
    ],
)
def test_credentials_that_are_refused_are_named_by_the_server_s_code(
    remote, refusing, monkeypatch, status, code, text
):
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{refusing.server_port}")
    refusing.answer, refusing.asked = (status, code), 0
    with pytest.raises(InputError, match=text) as caught:
        open_store("s3://cars/results")
    assert "\n" not in str(caught.value)
    assert refusing.asked == 1  # what is refused is refused again


@pytest.mark.parametrize(
    "answer", [(301, ""), (301, "PermanentRedirect"), (302, "", "/"), (307, "", "/x")]
)
def test_a_server_that_redirects_without_end_is_one_line(remote, refusing, monkeypatch, answer):
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{refusing.server_port}")
    refusing.answer, refusing.asked = answer, 0
    with pytest.raises(InputError, match=r"cars/results/: the server redirects each .*region"):
        open_store("s3://cars/results")
    assert refusing.asked < 200  # by one try


def test_an_address_that_never_answers_is_not_tried_again(remote, monkeypatch):
    monkeypatch.setattr(store_remote, "CHECK_S", -1.0)
    system = faulty(remote, TRANSIENT * 10)
    with pytest.raises(InputError, match=r"after 1 try \("):
        remote.check()
    assert system.calls == 1


def test_a_file_is_no_store(tmp_path):
    (tmp_path / "f").write_bytes(b"")
    with pytest.raises(InputError, match="is a file: give a folder"):
        open_store(str(tmp_path / "f"))
    assert open_store(f"file://{tmp_path}/new%20one").local == tmp_path / "new one"


class Faulty:
    """A file system whose requests fail at first, before they are done or after."""

    def __init__(self, real, faults, done=False):
        self.real, self.faults, self.done, self.calls = real, list(faults), done, 0

    def __getattr__(self, name):
        real = getattr(self.real, name)

        def call(*arguments, **options):
            self.calls += 1
            if self.faults:
                if self.done:
                    real(*arguments, **options)
                raise self.faults.pop(0)
            return real(*arguments, **options)

        return call


def faulty(remote, faults, done=False):
    remote._opened = os.getpid(), Faulty(remote._fs, faults, done)
    return remote._opened[1]


TRANSIENT = [OSError(errno.EBUSY, "SlowDown"), TimeoutError("late"), ConnectionResetError("reset")]


def test_passing_faults_of_object_storage_are_ridden_out(remote):
    assert remote.write_new("a", b"1")
    for ask in (
        lambda: remote.read("a") == b"1",
        lambda: names(remote) == ["a"],
        lambda: remote.exists("a"),
        lambda: remote.write("a", b"1") is None,
        lambda: remote.write_new("b", b"1"),
    ):
        system = faulty(remote, TRANSIENT)
        assert ask()
        assert system.calls == len(TRANSIENT) + 1
        remote._opened = None


def test_a_fault_that_stays_is_one_line(remote):
    assert remote.exclusive
    system = faulty(remote, TRANSIENT * 10)
    with pytest.raises(InputError, match=f"results/a: .*after {store_remote.TRIES} tries"):
        remote.write_new("a", b"1")
    assert system.calls == store_remote.TRIES
    system.faults = [PermissionError("Access Denied")]
    with pytest.raises(InputError, match="Access Denied"):
        remote.read("a")
    assert system.calls == store_remote.TRIES + 1


def test_a_patient_store_waits_notes_it_and_tells_since_when_it_is_back(remote, monkeypatch):
    remote.write("a", b"1")
    notes: list[str] = []
    remote.be_patient(notes.append)
    for faults, noted in ((TRANSIENT, 0), (TRANSIENT * 10, 1), (TRANSIENT * 10, 1)):
        began_s, before_s = time.monotonic(), remote.back_s
        faulty(remote, faults)
        assert remote.read("a") == b"1"
        assert len(notes) == noted  # once a minute
        assert remote.back_s == before_s if not noted else remote.back_s >= began_s
        remote._opened = None
    assert f"after {store_remote.TRIES} tries" in notes[0]
    assert "waiting for it up to 30 min" in notes[0]
    monkeypatch.setattr(store_remote, "AWAY_S", 0.0)
    system = faulty(remote, TRANSIENT * 10)
    with pytest.raises(InputError, match=f"after {store_remote.TRIES} tries"):
        remote.read("a")
    assert system.calls == store_remote.TRIES


def test_a_store_that_is_no_longer_patient_ends_what_waits(remote):
    assert remote.exclusive
    notes: list[str] = []

    def noted(text):
        notes.append(text)
        remote.be_patient(None)

    remote.be_patient(noted)
    faulty(remote, TRANSIENT * 100)
    with pytest.raises(InputError, match=f"after {store_remote.TRIES + 1} tries"):
        remote.read("a")
    assert len(notes) == 1


def test_a_put_whose_answer_was_lost_is_known_as_done(remote):
    assert remote.exclusive
    faulty(remote, TRANSIENT[:1], done=True)
    assert remote.write_new("a", b"mine")
    faulty(remote, [])
    assert not remote.write_new("a", b"mine")


def test_a_server_that_ignores_the_condition_is_found_out(remote):
    class Ignorant(Faulty):
        def pipe_file(self, path, data, mode="overwrite"):
            return self.real.pipe_file(path, data)

    remote._opened = os.getpid(), Ignorant(remote._fs, [])
    assert not remote.exclusive
    assert remote.write_new("a", b"1")
    assert not remote.write_new("a", b"2")
    assert remote.read("a") == b"1"
    assert names(remote) == ["a"]


def test_a_store_goes_to_another_process(remote):
    assert remote.write_new("a", b"1")
    copy = pickle.loads(pickle.dumps(remote))
    assert copy._opened is None
    assert copy.read("a") == b"1"


def test_more_objects_than_a_page_are_listed(remote):
    real = remote._fs

    class Paged(Faulty):
        def call_s3(self, method, **options):
            self.calls += 1
            return real.call_s3(method, MaxKeys=2, **options)

    for i in range(5):
        real.pipe_file(f"cars/results/{i}", b"1")
    real.pipe_file("cars/resultset", b"1")
    remote._opened = os.getpid(), Paged(real, [])
    assert names(remote) == list("01234")
    assert remote._opened[1].calls == 3


def test_another_kind_of_storage_by_fsspec(tmp_path):
    store = open_store("memory://somewhere/deep")
    assert names(store) == []
    assert store.write_new("a/b", b"1")
    assert not store.write_new("a/b", b"2")
    store.write("c", b"22")
    assert [(e.name, e.size) for e in store.list()] == [("a/b", 1), ("c", 2)]
    assert store.fetch("a/b", tmp_path).read_bytes() == b"1"
    store.remove("c")
    assert names(store, "a/") == ["a/b"]
