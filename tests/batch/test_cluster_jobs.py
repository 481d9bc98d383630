"""Jobs of the manual for clusters: scripts run, manifests have known fields, shards divide."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from pathlib import Path

import msgspec
import pytest
import yaml
from lightkube.models import apps_v1, batch_v1

from tests.support.batches import archive_of, left, poisoned, run, start
from tests.support.paths import ROOT
from wheelplane.batch.plan.shard import read_shard

CHAPTER = (ROOT / "pipeline" / "manual" / "13-batch.md").read_text()
KINDS = {"Job": batch_v1.Job, "Deployment": apps_v1.Deployment}
MANIFESTS = [
    yaml.safe_load(text) for text in re.findall(r"^```yaml\n(.*?)^```", CHAPTER, re.M | re.S)
]
SCRIPTS = re.findall(r"^```bash\n(.*?)^```", CHAPTER, re.M | re.S)
NAMES = [f"{k // 10:02d}/car-{k:04d}" for k in range(2000)]


def called(script: str, folder: Path, status: int = 0, **environment: str) -> tuple[int, list[str]]:
    """Run a script with a `wheelplane` that notes its arguments; its exit code, and those."""
    noted = folder / "noted"
    program = folder / "wheelplane"
    program.write_text(f'#!/bin/sh\nprintf "%s\\n" "$@" > {noted}\nexit {status}\n')
    program.chmod(0o755)
    path = f"{folder}:{os.environ['PATH']}"
    ended = subprocess.run(["bash", "-c", script], env={"PATH": path, **environment}, check=False)
    return ended.returncode, noted.read_text().splitlines()


def shard_of(arguments: list[str]):
    return read_shard(arguments[arguments.index("--shard") + 1])


def divides(shards) -> bool:
    """Whether each capture is in one shard, and none of the shards is far above its share."""
    counts = [sum(shard.holds(name) for name in NAMES) for shard in shards]
    holders = {sum(shard.holds(name) for shard in shards) for name in NAMES}
    return holders == {1} and max(counts) < 1.5 * len(NAMES) / len(shards)


@pytest.mark.parametrize("manifest", MANIFESTS, ids=[one["kind"] for one in MANIFESTS])
def test_manifests_have_known_fields_of_their_types(manifest):
    assert msgspec.to_builtins(msgspec.convert(manifest, KINDS[manifest["kind"]])) == manifest


@pytest.mark.parametrize(
    ("place", "value"), [(["spec", "completion"], 16), (["spec", "completions"], "x")]
)
def test_a_wrong_field_or_type_is_seen(place, value):
    wrong = yaml.safe_load(yaml.safe_dump(MANIFESTS[0]))
    wrong[place[0]][place[1]] = value
    with pytest.raises((msgspec.ValidationError, AssertionError)):
        test_manifests_have_known_fields_of_their_types(wrong)


@pytest.mark.parametrize("script", SCRIPTS, ids=[text.split()[0] for text in SCRIPTS])
def test_scripts_are_of_the_shell(script):
    subprocess.run(["bash", "-n", "-c", script], check=True)


def test_tasks_of_the_slurm_array_divide_the_archive(tmp_path):
    (script,) = [text for text in SCRIPTS if "SBATCH" in text]
    first, last = map(int, re.search(r"--array=(\d+)-(\d+)", script).groups())
    tasks = [called(script, tmp_path, SLURM_ARRAY_TASK_ID=str(k)) for k in range(first, last + 1)]
    assert divides([shard_of(arguments) for _, arguments in tasks])


def test_pods_of_the_indexed_job_divide_the_archive(tmp_path):
    spec = MANIFESTS[0]["spec"]
    (script,) = spec["template"]["spec"]["containers"][0]["args"]
    pods = [
        called(script, tmp_path, JOB_COMPLETION_INDEX=str(k)) for k in range(spec["completions"])
    ]
    assert divides([shard_of(arguments) for _, arguments in pods])


@pytest.mark.parametrize(
    ("status", "again"), [(0, False), (1, False), (2, True), (3, True), (143, True)]
)
def test_a_pod_runs_again_where_the_run_itself_failed(tmp_path, status, again):
    (script,) = MANIFESTS[0]["spec"]["template"]["spec"]["containers"][0]["args"]
    code, _ = called(script, tmp_path, status, JOB_COMPLETION_INDEX="0")
    assert (code != 0) is again


def test_sigterm_hands_back_what_is_at_work_and_keeps_what_is_done(tmp_path):
    archive = archive_of(tmp_path / "archive", 4)
    undisturbed = run(archive, tmp_path / "undisturbed")
    (archive / "00" / "car-0001.txt").rename(archive / "00" / "hang.txt")
    started = start(archive, tmp_path / "results", "--workers", "2", **poisoned(tmp_path))
    done = tmp_path / "results" / "measurements"
    while len(list(done.rglob("*.json"))) < 3:
        assert started.poll() is None
        time.sleep(0.1)
    began = time.monotonic()
    started.send_signal(signal.SIGTERM)
    started.communicate(timeout=20)
    assert time.monotonic() - began < 20.0
    assert started.returncode not in (0, 1)
    (archive / "00" / "hang.txt").rename(archive / "00" / "car-0001.txt")
    again = run(archive, tmp_path / "results")
    assert again.returncode == undisturbed.returncode == 0
    assert "now: 1 ok, 3 recognised" in again.stdout
    kept = left(tmp_path / "results")
    assert {k for k in kept if k.endswith(".json")} == {
        k for k in left(tmp_path / "undisturbed") if k.endswith(".json")
    }
