"""The built wheel, installed elsewhere, measures: from wherever it is called, whatever is set."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.support.batches import archive_of
from tests.support.made import write_small_capture
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow
PLAIN = {"PATH": os.environ["PATH"], "PYTHONWARNINGS": "error::EncodingWarning"}
PLAIN |= {  # other kernels of the arithmetic differ in the last digits: they are the machine's
    name: value for name, value in os.environ.items() if name.startswith("OPENBLAS_")
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """An environment with the wheel, which finds its dependencies in that of the tests."""
    folder = tmp_path_factory.mktemp("install")
    code = f"from hatchling.build import build_wheel; build_wheel({str(folder)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True)
    venv.create(folder / "environment", symlinks=True)
    python = folder / "environment" / "bin" / "python"
    (site,) = (folder / "environment").glob("lib/python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    subprocess.run(
        [
            *(sys.executable, "-m", "uv", "pip", "install", "--quiet", "--no-deps", "--offline"),
            *("--python", str(python), str(next(folder.glob("*.whl")))),
        ],
        check=True,
    )
    return folder / "environment"


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    return write_small_capture(tmp_path_factory.mktemp("small") / "capture", trials=0)


@pytest.fixture(scope="module")
def expected(installed, capture):
    """The wheels as measured with the environment of the tests."""
    return wheels(run(installed, "measure", capture, "--json", **os.environ))


def run(installed, *arguments, prefix=(), cwd=None, **environment):
    """Run the installed command, with the given variables alone."""
    environment.pop("PYTHONPATH", None)
    ended = subprocess.run(
        [*prefix, installed / "bin" / "wheelplane", *arguments],
        env=environment,
        cwd=cwd or installed.parent,
        capture_output=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr.decode()
    return ended.stdout


def wheels(printed):
    return json.loads(printed)["wheels"]


def unshared(commands):
    """Begin a command in a mount namespace where these have been run; skip without the right."""
    prefix = ("unshare", "--mount", "sh", "-c", f'{commands} && exec "$0" "$@"')
    if shutil.which("unshare") is None:
        pytest.skip("there is no unshare")
    tried = subprocess.run([*prefix, "true"], capture_output=True, text=True, check=False)
    if tried.returncode:
        pytest.skip(f"unshare is refused: {tried.stderr.strip()}")
    return prefix


def test_what_runs_is_the_wheel(installed):
    code = "import wheelplane, wheelplane_synth; print(wheelplane.__file__)"
    python = installed / "bin" / "python"
    found = subprocess.run([python, "-P", "-c", code], capture_output=True, text=True, env=PLAIN)
    assert Path(found.stdout.strip()).is_relative_to(installed), found.stderr


def test_from_an_empty_folder_without_home(installed, capture, expected, tmp_path):
    assert "HOME" not in PLAIN
    got = run(installed, "measure", capture, "--json", cwd=tmp_path, **PLAIN)
    assert wheels(got) == expected
    assert list(tmp_path.iterdir()) == []


def test_in_read_only_packages(installed, capture, expected):
    site = str(installed)
    read_only = f"mount --bind '{site}' '{site}' && mount -o remount,ro,bind '{site}'"
    prefix = unshared(f"{read_only} && ! touch '{site}/new' 2>/dev/null")
    before = sorted(installed.rglob("*"))
    got = run(installed, "measure", capture, "--json", prefix=prefix, HOME="/none", **PLAIN)
    assert wheels(got) == expected
    assert sorted(installed.rglob("*")) == before


@pytest.mark.parametrize("locale", ["C", "POSIX"])
def test_with_blanks_and_unicode_in_paths_and_no_locale(
    installed, capture, expected, tmp_path, locale
):
    folder = tmp_path / "Garagem nº 3" / "medição 車"
    shutil.copytree(capture, folder / "viatura ☃")
    stated = {"LANG": locale, "LC_ALL": locale, "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    arguments = ("measure", "viatura ☃", "-o", "saída é")
    run(installed, *arguments, cwd=folder, TMPDIR=str(folder), **PLAIN, **stated)
    assert wheels((folder / "saída é" / "measurement.json").read_bytes()) == expected
    assert {path.name for path in folder.iterdir()} == {"viatura ☃", "saída é"}


def test_without_shared_memory(installed, capture, expected, tmp_path):
    prefix = unshared("mount -t tmpfs -o ro none /dev/shm")
    got = run(installed, "measure", capture, "--json", prefix=prefix, **PLAIN)
    assert wheels(got) == expected
    archive = archive_of(tmp_path / "archive", 2)
    run(installed, "batch", archive, "-o", tmp_path / "results", prefix=prefix, **PLAIN)
    assert len(list((tmp_path / "results" / "measurements").rglob("*.json"))) == 2
