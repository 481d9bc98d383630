"""The same catalogue from a Dask cluster and from faulty object storage; a folder under watch."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path

import distributed
import pytest

from tests.support.batches import (
    ROOT,
    archive_of,
    five_points,
    kill,
    left,
    poisoned,
    run,
    run_process,
    start,
    trees,
)
from tests.support.failing_proxy import FailingProxy
from tests.support.object_server import object_server
from tests.support.planted import Planted
from wheelplane.batch.catalogue.catalogue import FILE, open_catalogue, rebuild
from wheelplane.batch.results.query import count
from wheelplane.batch.storage.store import open_store

DASK = [sys.executable, str(Path(sys.executable).with_name("dask"))]  # -m adds the current folder


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """An archive of captures, some bad, and its results by one worker of this machine."""
    folder = tmp_path_factory.mktemp("undisturbed")
    archive = archive_of(folder / "archive", 20)
    (archive / "bad.txt").write_text("no number\n")
    assert run(archive, folder / "results", "--workers", "1").returncode == 1
    return archive, left(folder / "results")


@pytest.fixture
def cluster(tmp_path):
    """The address of a scheduler with two workers, in three processes; and the workers."""
    with dask_cluster(tmp_path) as (address, _, workers):
        yield address, workers


@contextmanager
def dask_cluster(tmp_path, port: str = "0", names: str = "ab"):
    """A scheduler with a worker of each name: its address, its process, and theirs."""
    environment = os.environ | {
        "DASK_DISTRIBUTED__WORKER__DAEMON": "False",
        **poisoned(tmp_path),
    }
    environment.pop("LD_LIBRARY_PATH", None)  # in which OpenCV, imported by tests, left this folder
    path = f"{ROOT}{os.pathsep}{environment['PYTHONPATH']}"
    common = {"cwd": tmp_path, "env": environment | {"PYTHONPATH": path}}
    with ExitStack() as stack:
        scheduler = subprocess.Popen(
            [*DASK, "scheduler", "--no-dashboard", "--host", "127.0.0.1", "--port", port],
            stderr=subprocess.PIPE,
            text=True,
            **common,
        )
        stack.enter_context(scheduler)
        stack.callback(scheduler.kill)
        address = None
        for line in scheduler.stderr:
            found = re.search(r"tcp://127\.0\.0\.1:\d+", line)
            if found:
                address = found[0]
                break
        workers = []
        for name in names:
            worker = subprocess.Popen(
                [*DASK, "worker", address, "--no-dashboard", "--nthreads", "1", "--name", name],
                stderr=subprocess.DEVNULL,
                start_new_session=True,
                **common,
            )
            workers.append(worker)
            stack.enter_context(worker)
            stack.callback(os.killpg, worker.pid, signal.SIGKILL)
        with distributed.Client(address) as client:
            client.wait_for_workers(len(workers), timeout=60)
        yield address, scheduler, workers


@pytest.mark.slow
def test_a_cluster_gives_the_same_catalogue(undisturbed, cluster, tmp_path):
    archive, expected = undisturbed
    address, _ = cluster
    done = run_process(archive, tmp_path / "results", "--scheduler", address)
    assert done.returncode == 1, done.stderr
    assert left(tmp_path / "results") == expected
    more = shutil.copytree(archive, tmp_path / "archive")
    five_points(more / "crash.txt", 1)
    five_points(more / "hang.txt", 2)
    options = ("--scheduler", address, "--resume", "--timeout", "3")
    assert run_process(more, tmp_path / "results", *options).returncode == 1
    found = trees(tmp_path / "results")
    bad = {name for name, tree in found.items() if tree["batch"]["status"] == "quarantined"}
    assert bad == {"crash.txt", "hang.txt"}
    assert len(found) == 23


@pytest.mark.slow
def test_a_lost_worker_changes_nothing(cluster, tmp_path):
    address, workers = cluster
    archive, results = archive_of(tmp_path / "archive", 400), tmp_path / "results"
    assert run(archive, tmp_path / "undisturbed", "--workers", "2").returncode == 0
    with start(archive, results, "--scheduler", address) as runner:
        while runner.poll() is None and not any(results.rglob("measurements/*/*.json")):
            time.sleep(0.01)
        assert runner.poll() is None
        os.killpg(workers[0].pid, signal.SIGKILL)
        _, err = runner.communicate(timeout=120)
    assert runner.returncode == 0, err
    assert left(results) == left(tmp_path / "undisturbed")


@pytest.mark.slow
def test_a_run_whose_scheduler_is_lost_waits_for_it_and_goes_on(tmp_path):
    archive, results = archive_of(tmp_path / "archive", 400), tmp_path / "results"
    assert run(archive, tmp_path / "undisturbed", "--workers", "2").returncode == 0
    with dask_cluster(tmp_path) as (address, scheduler, _):
        runner = start(archive, results, "--scheduler", address)
        wait_for(lambda: runner.poll() is not None or any(results.rglob("measurements/*/*.json")))
        assert runner.poll() is None
        scheduler.kill()
        scheduler.wait()
        with dask_cluster(tmp_path, address.rpartition(":")[2]) as (again, _, _):
            assert again == address
            out, err = runner.communicate(timeout=120)
    assert runner.returncode == 0, out + err
    assert err.count("the Dask scheduler is lost: waiting for it") == 1
    assert "Traceback" not in out + err
    assert left(results) == left(tmp_path / "undisturbed")


def test_a_result_that_a_lost_scheduler_keeps_is_measured_again(cluster, tmp_path, monkeypatch):
    """The task had ended; the connection over which its result was to come breaks."""
    gather, broken = distributed.Client._gather, []

    async def break_once(*arguments, **options):
        if not broken:
            broken.append(True)
            raise distributed.comm.CommClosedError("connection reset by peer")
        return await gather(*arguments, **options)

    monkeypatch.setattr(distributed.Client, "_gather", break_once)
    archive, results = archive_of(tmp_path / "archive", 6), tmp_path / "results"
    done = run(archive, results, "--scheduler", cluster[0])
    assert done.returncode == 0, done.stderr
    assert broken
    assert done.stderr.count("the Dask scheduler is lost: waiting for it") == 1
    assert len(list(results.rglob("measurements/*/*.json"))) == 6


@pytest.mark.slow
def test_a_run_whose_scheduler_stays_lost_ends_with_what_is_done(tmp_path, monkeypatch):
    archive, results = archive_of(tmp_path / "archive", 400), tmp_path / "results"
    monkeypatch.setattr("wheelplane.batch.run.cluster.WAIT_S", 0.5)
    monkeypatch.setattr("wheelplane.batch.run.cluster.CONNECT_S", 5.0)
    with dask_cluster(tmp_path) as (address, scheduler, _):

        def lose() -> None:
            wait_for(lambda: any(results.rglob("measurements/*/*.json")))
            scheduler.kill()

        loser = threading.Thread(target=lose)
        loser.start()
        ended = run(archive, results, "--scheduler", address)
        loser.join()
    assert ended.returncode == 2, ended.stdout + ended.stderr
    assert "the Dask scheduler is lost: start it and repeat the command" in ended.stderr
    assert "Traceback" not in ended.stdout + ended.stderr
    done = len(list(results.rglob("measurements/*/*.json")))
    with open_catalogue(str(results)) as catalogue:
        assert 0 < count(catalogue) == done < 400
    after = run(archive, results, "--workers", "2")
    assert after.returncode == 0, after.stderr
    assert run(archive, tmp_path / "undisturbed", "--workers", "2").returncode == 0
    assert left(results) == left(tmp_path / "undisturbed")


@pytest.mark.slow
def test_a_worker_of_a_cluster_takes_nothing_from_its_folder(cluster, tmp_path):
    """What lies there when our processes start; it may not have lain there when Dask's did."""
    planted = Planted(tmp_path / "planted", ("hashlib", "sqlite3", "rich", "sitecustomize"))
    for path in planted.folder.iterdir():
        shutil.move(path, tmp_path)
    done = run_process(
        archive_of(tmp_path / "archive", 4), tmp_path / "results", "--scheduler", cluster[0]
    )
    assert (done.returncode, planted.ran) == (0, []), done.stderr


def test_no_scheduler_is_one_line(undisturbed, tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.batch.run.cluster.CONNECT_S", 0.5)
    done = run(undisturbed[0], tmp_path / "results", "--scheduler", "tcp://127.0.0.1:1")
    assert (done.returncode, done.stdout) == (2, "")
    assert "no Dask scheduler answers" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.fixture(scope="module")
def storage():
    """The address of a server of object storage on this machine."""
    with object_server() as address:
        yield address


@pytest.mark.slow
def test_object_storage_that_fails_now_and_then_gives_the_same(
    undisturbed, storage, tmp_path, monkeypatch
):
    import s3fs

    archive, expected = undisturbed
    for key, value in (
        ("AWS_ACCESS_KEY_ID", "k"),
        ("AWS_SECRET_ACCESS_KEY", "s"),
        ("AWS_DEFAULT_REGION", "us-east-1"),
        ("AWS_REQUEST_CHECKSUM_CALCULATION", "when_required"),
    ):
        monkeypatch.setenv(key, value)
    files = s3fs.S3FileSystem(endpoint_url=storage, skip_instance_cache=True)
    files.mkdir("failing")
    files.put(str(archive), "failing/archive", recursive=True)
    proxy = FailingProxy(storage, share=0.2, seed=1)
    done = run_process(
        "s3://failing/archive", "s3://failing/results", AWS_ENDPOINT_URL=proxy.address
    )
    proxy.close()
    assert done.returncode == 1, done.stderr
    assert proxy.failed > 10
    files.get("failing/results", str(tmp_path / "results"), recursive=True)
    assert left(tmp_path / "results") == expected
    again = run_process("s3://failing/archive", "s3://failing/results", AWS_ENDPOINT_URL=storage)
    assert "21 captures: 21 done before, 0 to do" in again.stderr

    # what was written went to segments as well, which spare a catalogue the reading
    monkeypatch.setenv("AWS_ENDPOINT_URL", storage)
    monkeypatch.setattr("wheelplane.batch.catalogue.segments.WORTH", 5)
    results = open_store("s3://failing/results")
    read, real = [], type(results).read
    monkeypatch.setattr(
        type(results), "read", lambda self, name: read.append(name) or real(self, name)
    )
    assert rebuild(results) == 21
    assert [name for name in read if not name.startswith("segments/")] == []
    assert 0 < len(read) < 21
    assert real(results, FILE) == expected[FILE]


@pytest.mark.slow
def test_sigterm_ends_a_run_that_waits_for_storage(undisturbed, storage, tmp_path):
    """Its grace is 20 s; before, each request of the last catalogue waited for half an hour."""
    import s3fs

    archive, _ = undisturbed
    keys = {"AWS_ACCESS_KEY_ID": "k", "AWS_SECRET_ACCESS_KEY": "s", "AWS_DEFAULT_REGION": "x"}
    files = s3fs.S3FileSystem(key="k", secret="s", endpoint_url=storage, skip_instance_cache=True)
    files.mkdir("away")
    files.put(str(archive), "away/archive", recursive=True)
    proxy = FailingProxy(storage, share=0.0, seed=1)
    places = ("s3://away/archive", "s3://away/results")
    stopped = start(*places, "--workers", "1", AWS_ENDPOINT_URL=proxy.address, **keys)
    while stopped.poll() is None and not files.glob("away/results/measurements/*/*.json"):
        time.sleep(0.05)
        files.invalidate_cache()
    assert stopped.poll() is None
    proxy.gone = True
    stopped.send_signal(signal.SIGTERM)
    try:
        _, err = stopped.communicate(timeout=20)
    finally:
        stopped.kill()
    assert stopped.returncode == 2
    assert err.splitlines()[-1].endswith("catalogue was updated: run the same command to go on")
    assert "Traceback" not in err
    proxy.gone = False
    done = run_process(*places, AWS_ENDPOINT_URL=proxy.address, **keys)
    assert done.returncode == 1
    assert "recognised" in done.stdout
    proxy.close()


@pytest.mark.slow
def test_runners_at_once_in_object_storage_one_of_them_killed(undisturbed, storage, tmp_path):
    """Two shards and a killed runner of all: no lock is left, and the last shard has merged."""
    import s3fs

    archive, expected = undisturbed
    keys = {"AWS_ACCESS_KEY_ID": "k", "AWS_SECRET_ACCESS_KEY": "s", "AWS_ENDPOINT_URL": storage}
    keys |= {"AWS_DEFAULT_REGION": "us-east-1"}
    files = s3fs.S3FileSystem(key="k", secret="s", endpoint_url=storage, skip_instance_cache=True)
    files.mkdir("shards")
    files.put(str(archive), "shards/archive", recursive=True)
    places = ("s3://shards/archive", "s3://shards/results")
    killed = start(*places, "--workers", "1", **keys)
    while killed.poll() is None and not files.glob("shards/results/measurements/*/*.json"):
        time.sleep(0.05)
        files.invalidate_cache()
    assert killed.poll() is None
    shards = [start(*places, "--workers", "1", "--shard", f"{k}/2", **keys) for k in (1, 2)]
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    for shard in shards:
        _, err = shard.communicate(timeout=200)
        assert shard.returncode in (0, 1), err
    files.get("shards/results", str(tmp_path / "results"), recursive=True)
    assert left(tmp_path / "results") == expected
    assert not [path for path in files.find("shards/results") if "lock" in path]


def test_a_watched_folder_takes_what_is_complete_and_ends_with_ctrl_c(undisturbed, tmp_path):
    archive = tmp_path / "archive"
    archive.mkdir()
    results = tmp_path / "results"
    process = start(archive, results, "--watch", "--settle", "1", "--workers", "1")
    try:
        (archive / "car").mkdir()
        for wheel in ("rr", "rl", "fr"):
            (archive / "car" / f"{wheel}.xyz").write_text("0 0 0\n")
        source = undisturbed[0] / "00" / "car-0000.txt"
        growing = (archive / "grows.txt").open("w")
        lines = source.read_text().splitlines(keepends=True)
        for line in lines:
            growing.write(line)
            growing.flush()
            time.sleep(0.08)  # 1.6 s in all: longer than it takes to settle
            assert not list(results.glob("measurements/*/*.json"))
        growing.close()
        wait_for(lambda: len(list(results.glob("measurements/*/*.json"))) == 1)
        assert trees(results)["grows.txt"]["batch"]["status"] == "ok"
        (archive / "car" / "fl.xyz").write_text("0 0 0\n")
        wait_for(lambda: len(list(results.glob("measurements/*/*.json"))) == 2)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    finally:
        kill(process.pid)
    assert process.returncode == 1, err  # a cloud of one point is no car
    assert "1 ok, 1 failed" in out
    assert "Traceback" not in out + err


def wait_for(condition) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)
