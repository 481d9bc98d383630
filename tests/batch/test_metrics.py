"""Metrics of the runs: a parser of OpenMetrics reads them, by file and by HTTP, at any time."""

from __future__ import annotations

import re
import threading
import time
import urllib.request
from urllib.error import HTTPError

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families

from tests.support.batches import archive_of, call, run
from wheelplane.batch.operation.metrics import CONTENT_TYPE, FAMILIES, metrics_at, metrics_text
from wheelplane.batch.operation.run_state import AtWork, RunState, write_state
from wheelplane.batch.storage.store import open_store
from wheelplane.errors import InputError

ODD = 'node "1"\\ \n\x1b[2J'


@pytest.fixture
def results(tmp_path):
    store = open_store(str(tmp_path / "results"))
    now_s = time.time()
    task = AtWork(("a", "b"), now_s - 30.0, "worker 2")
    works = RunState(ODD, "2/4", now_s - 100.0, now_s, 5, 1000, at_work=(task,))
    works.done = {"ok": 180, "failed": 20}
    write_state(store, "b", works)
    write_state(store, "a", RunState("lost", "1/1", now_s - 900.0, now_s - 600.0, 0, 10))
    return store


def samples(text):
    """Values by name and the labels that a test asks for."""
    families = list(text_string_to_metric_families(text))
    assert {f"{family.name}" for family in families} == set(FAMILIES)
    return {
        (one.name, one.labels["run"], one.labels.get("status", "")): (one.value, one.labels)
        for family in families
        for one in family.samples
    }


def test_a_parser_reads_the_state_of_each_run(results):
    found = samples(metrics_text(results))
    value = {key: each[0] for key, each in found.items()}
    assert value["wheelplane_captures_total", "b", "ok"] == 180
    assert value["wheelplane_captures_total", "b", "failed"] == 20
    assert value["wheelplane_captures_before", "b", ""] == 5
    assert value["wheelplane_captures_left", "b", ""] == 800
    assert value["wheelplane_captures_at_work", "b", ""] == 2
    assert value["wheelplane_longest_at_work_seconds", "b", ""] == pytest.approx(30.0, abs=5.0)
    assert (value["wheelplane_run_up", "b", ""], value["wheelplane_run_up", "a", ""]) == (1, 0)
    assert value["wheelplane_captures_at_work", "a", ""] == 0
    assert found["wheelplane_run_up", "b", ""][1] == {"runner": ODD, "run": "b", "shard": "2/4"}


def test_without_a_run_there_are_no_samples(tmp_path):
    assert samples(metrics_text(open_store(str(tmp_path)))) == {}


def test_a_port_answers_while_it_lasts(results):
    with metrics_at(results, "127.0.0.1:0") as address:
        with urllib.request.urlopen(address) as answer:
            assert answer.headers["Content-Type"] == CONTENT_TYPE
            assert samples(answer.read().decode())
        with pytest.raises(HTTPError):
            urllib.request.urlopen(address.removesuffix("/metrics"))
        port = re.search(r":(\d+)/", address)[1]
        with pytest.raises(InputError, match="give another port"), metrics_at(results, port):
            pass
    with pytest.raises(OSError, match="refused"):
        urllib.request.urlopen(address)
    assert threading.active_count() < 20


def test_a_file_is_whole_at_any_time(results, tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.batch.operation.metrics.RENEWED_S", 0.001)
    file = tmp_path / "wheelplane.prom"
    with metrics_at(results, str(file)):
        for _ in range(200):
            assert file.read_text().endswith("# EOF\n")
    assert [path.name for path in tmp_path.glob("*wheelplane.prom*")] == [file.name]
    with (
        pytest.raises(InputError, match="cannot be written"),
        metrics_at(results, str(tmp_path / "none" / "x.prom")),
    ):
        pass


def test_faults_of_the_results_are_said_and_do_not_end_the_metrics(results, tmp_path, monkeypatch):
    def away(_: object) -> str:
        raise InputError("the storage is away")

    monkeypatch.setattr("wheelplane.batch.operation.metrics.RENEWED_S", 0.001)
    file = tmp_path / "wheelplane.prom"
    with metrics_at(results, str(file)), metrics_at(results, "127.0.0.1:0") as address:
        with monkeypatch.context() as patch:
            patch.setattr("wheelplane.batch.operation.metrics.metrics_text", away)
            with pytest.raises(HTTPError, match="503") as answer:
                urllib.request.urlopen(address)
            assert answer.value.read() == b"the storage is away\n"
        file.unlink()
        end = time.monotonic() + 20.0
        while not file.exists():
            assert time.monotonic() < end
        assert urllib.request.urlopen(address).status == 200


def test_a_run_leaves_its_end_in_the_file(tmp_path):
    archive = archive_of(tmp_path / "archive", 2)
    file = tmp_path / "wheelplane.prom"
    assert run(archive, tmp_path / "results", "--metrics", str(file)).returncode == 0
    value = {key[0]: each[0] for key, each in samples(file.read_text()).items()}
    assert value["wheelplane_captures_total"] == 2
    assert value["wheelplane_run_up"] == 0
    file.unlink()
    ended = call("batch", "--status", tmp_path / "results", "--metrics", file)
    assert ended.returncode == 0
    assert ended.stdout.endswith(f"metrics: {file}\n")
    assert samples(file.read_text())
