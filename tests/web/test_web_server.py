"""`wheelplane view` as a process: the address it prints, its port, its end."""

from __future__ import annotations

import http.client
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.web_site import PAPER
from wheelplane.commands.view import opened
from wheelplane.errors import InputError
from wheelplane.web.server import address_of, free_port

SEARCH_PATH = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
CODE = "import sys; sys.argv[0] = 'wheelplane'; from wheelplane.cli import main; main()"


@contextmanager
def started(place: Path, *arguments: str):
    """The command, and where it says that the page is."""
    scratch = place / "tmp"
    scratch.mkdir(exist_ok=True)
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", CODE, "view", "--no-browser", *arguments],
        cwd=place,
        env={"TMPDIR": str(scratch), "PYTHONPATH": SEARCH_PATH, "PATH": ""},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        said = []
        for line in process.stdout:
            said.append(line)
            if "Ctrl-C" in line:
                break
        yield process, "".join(said)
    finally:
        process.kill()
        process.communicate()


def ask(port: int, method: str = "GET", path: str = "/", **headers: str):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    connection.request(method, path, headers={k.replace("_", "-"): v for k, v in headers.items()})
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer, text


def port_in(said: str) -> int:
    return int(re.search(r"http://127\.0\.0\.1:(\d+)/", said)[1])


def test_it_serves_this_machine_and_ends_cleanly_on_ctrl_c(tmp_path):
    (tmp_path / "figure-4.txt").write_bytes(PAPER.read_bytes())
    with started(tmp_path, "--port", "0") as (process, said):
        port = port_in(said)
        answer, text = ask(port)
        assert answer.status == 200
        cookie = answer.headers["Set-Cookie"].split(";")[0]
        key = re.search(r'name="wheelplane-key" content="([^"]+)"', text)[1]
        answer, text = ask(port, "GET", "/api/files/0/", Cookie=cookie)
        assert "figure-4.txt" in text
        answer, text = ask(port, "PUT", "/api/uploads/x/a.ply", Cookie=cookie, X_Wheelplane_Key=key)
        assert answer.status == 404
        assert ask(port, Host="evil.example")[0].status == 421
        assert list((tmp_path / "tmp").iterdir())
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=20)
        assert process.returncode == 0
        assert out == "Stopped.\n"
        assert errors == ""
    assert list((tmp_path / "tmp").iterdir()) == []


def test_a_measurement_under_way_ends_with_the_page(tmp_path):
    rows = "".join(f"{i % 97}.5 {i % 91}.25 0.125\n" for i in range(10_000))
    (tmp_path / "rr.xyz").write_text(rows * 200)  # enough to be at work when the page ends
    with started(tmp_path, "--port", "0") as (process, said):
        port = port_in(said)
        answer, text = ask(port)
        cookie = answer.headers["Set-Cookie"].split(";")[0]
        key = re.search(r'name="wheelplane-key" content="([^"]+)"', text)[1]
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.request(
            "POST",
            "/api/measure",
            body='{"root": 0, "path": "rr.xyz", "options": {"target": "disc-250"}}',
            headers={"Cookie": cookie, "X-Wheelplane-Key": key, "Content-Type": "application/json"},
        )
        assert b'"state":' in connection.getresponse().read()
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)
        assert process.returncode == 0
    assert list((tmp_path / "tmp").iterdir()) == []
    listed = subprocess.run(["/bin/ps", "-eo", "args"], capture_output=True, text=True, check=False)
    assert str(tmp_path) not in listed.stdout


def test_a_busy_port_gives_way_to_the_next(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with started(tmp_path, "--port", str(port)) as (_, said):
            assert f"Port {port} is in use" in said
            assert port_in(said) != port
            assert ask(port_in(said))[0].status == 200


def test_what_is_opened_at_once_is_in_the_address(tmp_path):
    (tmp_path / "my car.txt").write_bytes(PAPER.read_bytes())
    with started(tmp_path, "--port", "0", "my car.txt") as (_, said):
        assert "/#open=0/my%20car.txt" in said


@pytest.mark.parametrize(
    ("source", "folders", "allowed", "start_at"),
    [
        ("car", (), ["car"], "#open=0/"),
        ("link", (), ["car"], "#open=0/"),
        ("car/..", (), ["."], ""),  # a folder of captures is there to choose from
        ("results", (), ["results"], "#archive=0/"),
        ("my car.txt", (), ["."], "#open=0/my%20car.txt"),
        ("car", ("results",), ["car", "results"], "#open=0/"),
        ("car", ("results", "."), ["results", "."], "#open=1/car"),
    ],
)
def test_what_is_opened_allows_itself_and_nothing_above(
    tmp_path, monkeypatch, source, folders, allowed, start_at
):
    (tmp_path / "my car.txt").write_bytes(PAPER.read_bytes())
    (tmp_path / "results" / "measurements").mkdir(parents=True)
    (tmp_path / "car").mkdir()
    (tmp_path / "car" / "rr.ply").touch()
    (tmp_path / "link").symlink_to(tmp_path / "car")
    monkeypatch.chdir(tmp_path)
    got, said = opened(Path(source), tuple(Path(folder) for folder in folders))
    assert [folder.resolve() for folder in got] == [(tmp_path / name).resolve() for name in allowed]
    assert said == start_at


def test_the_current_folder_is_opened_as_the_capture_that_it_is(tmp_path):
    capture = tmp_path / "car"
    capture.mkdir()
    with started(capture, "--port", "0", ".") as (_, said):
        assert "#open" not in said
    (capture / "rr.ply").touch()
    with started(capture, "--port", "0", ".") as (_, said):
        assert said.splitlines()[0].endswith("/#open=0/")


def test_beyond_loopback_the_address_holds_a_token(tmp_path):
    with started(tmp_path, "--port", "0", "--host", "0.0.0.0") as (_, said):
        port, token = re.search(r"http://[^/:]+:(\d+)/\?token=([\w-]{32,})", said).groups()
        assert ask(int(port))[0].status == 403
        assert ask(int(port), "GET", f"/?token={token}")[0].status == 302


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["missing"], "missing: no such file or folder"),
        (["--folder", "missing"], "missing: no such folder"),
        (["--host", "192.0.2.1"], "--host 192.0.2.1"),
        (["--port", "99999"], "--port"),
    ],
)
def test_what_cannot_be_served_is_reported_in_one_line(tmp_path, arguments, said):
    run = subprocess.run(
        [sys.executable, "-c", CODE, "view", "--no-browser", *arguments],
        cwd=tmp_path,
        env={"PYTHONPATH": SEARCH_PATH, "PATH": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert run.returncode == 2
    assert run.stderr.count("\n") == 1
    assert said in run.stderr


def test_with_all_ports_taken_it_says_so(monkeypatch):
    monkeypatch.setattr("wheelplane.web.server.TRIED_PORTS", 1)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match="in use: give another"):
            free_port("127.0.0.1", port)


def test_addresses_of_version_6_stand_in_brackets():
    from wheelplane.web.security import Guard

    assert address_of("::1", Guard(80)) == "http://[::1]:80/"
