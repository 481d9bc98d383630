"""`wheelplane view` as a process: the address it prints, its port or socket, its end."""

from __future__ import annotations

import http.client
import json
import os
import pty
import re
import signal
import socket
import stat
import subprocess
import sys
import time
from contextlib import contextmanager
from html import unescape
from pathlib import Path

import pytest

from tests.support.web_site import PAPER
from wheelplane.commands.view import opened
from wheelplane.errors import InputError
from wheelplane.web.security import Guard
from wheelplane.web.server import address_of, free_port, unix_socket
from wheelplane.web.settings import Endpoint

SEARCH_PATH = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
CODE = "import sys; sys.argv[0] = 'wheelplane'; from wheelplane.cli import main; main()"


@contextmanager
def started(place: Path, *arguments: str, **environment: str):
    """The command, without a browser unless one is given, and where it says that the page is."""
    scratch = place / "tmp"
    scratch.mkdir(exist_ok=True)
    browser = [] if "BROWSER" in environment else ["--no-browser"]
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", CODE, "view", *browser, *arguments],
        cwd=place,
        env={"TMPDIR": str(scratch), "PYTHONPATH": SEARCH_PATH, "PATH": "", **environment},
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


def ask(port: int, method: str = "GET", path: str = "/", body: str = "", **headers: str):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    given = {k.replace("_", "-"): v for k, v in headers.items()}
    connection.request(method, path, body=body or None, headers=given)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer, text


def port_in(said: str) -> int:
    return int(re.search(r"http://127\.0\.0\.1:(\d+)/", said)[1])


def opening_in(said: str) -> Path:
    """The file that holds the address with the token."""
    return Path(re.search(r"the address in (\S+)", said)[1])


def address_in(said: str) -> str:
    return unescape(re.search(r'<a href="([^"]+)">', opening_in(said).read_text())[1])


def admitted(said: str) -> dict[str, str]:
    """The cookie for the token, and the key of the page that it opens."""
    token = re.search(r"#token=([\w-]{40,})", address_in(said))[1]
    port = port_in(said)
    body = json.dumps({"token": token})
    answer, _ = ask(port, "POST", "/api/session", body, Content_Type="application/json")
    assert answer.status == 204
    cookie = answer.headers["Set-Cookie"].split(";")[0]
    _, text = ask(port, Cookie=cookie)
    key = re.search(r'name="wheelplane-key" content="([^"]+)"', text)[1]
    return {"Cookie": cookie, "X_Wheelplane_Key": key}


def test_what_a_killed_page_left_is_removed_by_the_next_one_and_nothing_else(tmp_path):
    """The folder of a page that still runs stays, and so does what has no lock of a page."""
    (tmp_path / "tmp" / "wheelplane-page-notes").mkdir(parents=True)
    with started(tmp_path, "--port", "0") as (_, said):
        running = opening_in(said).parent
        with started(tmp_path, "--port", "0") as (killed, said):
            left = opening_in(said).parent
            (left / "upload").write_bytes(b"scan")
            killed.send_signal(signal.SIGKILL)
            killed.wait()
        assert left.is_dir()
        with started(tmp_path, "--port", "0") as (_, said):
            third = opening_in(said).parent
            folders = {path for path in (tmp_path / "tmp").iterdir() if path.is_dir()}
            assert folders == {running, third, tmp_path / "tmp" / "wheelplane-page-notes"}


def test_it_serves_this_machine_and_ends_cleanly_on_ctrl_c(tmp_path):
    (tmp_path / "figure-4.txt").write_bytes(PAPER.read_bytes())
    with started(tmp_path, "--port", "0") as (process, said):
        port, headers = port_in(said), admitted(said)
        answer, text = ask(port, "GET", "/api/files/0/", **headers)
        assert "figure-4.txt" in text
        answer, text = ask(port, "PUT", "/api/uploads/x/a.ply", "1 2 3", **headers)
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
        body = '{"root": 0, "path": "rr.xyz", "options": {"target": "disc-250"}}'
        headers = {"Content_Type": "application/json", **admitted(said)}
        _, text = ask(port_in(said), "POST", "/api/measure", body, **headers)
        assert '"state":' in text
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)
        assert process.returncode == 0
    assert list((tmp_path / "tmp").iterdir()) == []
    listed = subprocess.run(["/bin/ps", "-eo", "args"], capture_output=True, text=True, check=False)
    assert str(tmp_path) not in listed.stdout


def test_an_upload_under_way_ends_with_the_page(tmp_path):
    with started(tmp_path, "--port", "0") as (process, said):
        given = admitted(said)
        headers = {"Content_Type": "application/json", **given}
        _, text = ask(port_in(said), "POST", "/api/uploads", "{}", **headers)
        path = f"/api/uploads/{json.loads(text)['upload']}/rr.ply"
        lines = [f"{name.replace('_', '-')}: {value}" for name, value in given.items()]
        head = [f"PUT {path} HTTP/1.1", f"Host: 127.0.0.1:{port_in(said)}", *lines]
        with socket.create_connection(("127.0.0.1", port_in(said)), timeout=20) as client:
            size = 10_000_000
            client.sendall("\r\n".join([*head, f"Content-Length: {size}", "", ""]).encode())
            client.sendall(bytes(size // 2))
            process.send_signal(signal.SIGTERM)
            assert process.communicate(timeout=20) == ("Stopped.\n", "")
    assert list((tmp_path / "tmp").iterdir()) == []


def test_a_busy_port_gives_way_to_the_next(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with started(tmp_path, "--port", str(port)) as (_, said):
            assert f"Port {port} is in use" in said
            assert port_in(said) != port
            assert ask(port_in(said), path="/enter")[0].status == 200


def test_what_is_opened_at_once_is_in_the_address(tmp_path):
    (tmp_path / "my car.txt").write_bytes(PAPER.read_bytes())
    with started(tmp_path, "--port", "0", "my car.txt") as (_, said):
        assert address_in(said).endswith("&open=0/my%20car.txt")
        assert "open=" not in said


@pytest.mark.parametrize(
    ("source", "folders", "allowed", "start_at"),
    [
        ("car", (), ["car"], "open=0/"),
        ("link", (), ["car"], "open=0/"),
        ("car/..", (), ["."], ""),  # a folder of captures is there to choose from
        ("results", (), ["results"], "archive=0/"),
        ("my car.txt", (), ["."], "open=0/my%20car.txt"),
        ("car", ("results",), ["car", "results"], "open=0/"),
        ("car", ("results", "."), ["results", "."], "open=1/car"),
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
        assert "open=" not in address_in(said)
    (capture / "rr.ply").touch()
    with started(capture, "--port", "0", ".") as (_, said):
        assert address_in(said).endswith("&open=0/")


def test_no_log_and_no_argument_holds_the_token(tmp_path):
    """Other users read the arguments of processes, and often logs; not a file of mode 0600."""
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$0" "$@" > {tmp_path}/opened.part\n'
                       f"mv {tmp_path}/opened.part {tmp_path}/opened\nsleep 5\n")  # fmt: skip
    browser.chmod(0o755)
    given = {"BROWSER": f"{browser} %s", "PATH": "/usr/bin:/bin"}
    with started(tmp_path, "--port", "0", **given) as (process, said):
        opening = opening_in(said)
        token = re.search(r"#token=([\w-]+)", address_in(said))[1]
        until((tmp_path / "opened").exists)
        assert (tmp_path / "opened").read_text().split() == [str(browser), opening.as_uri()]
        for path in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                assert token.encode() not in path.read_bytes()
            except OSError:
                continue
        assert token not in said
        mode = stat.S_IMODE(opening.stat().st_mode), stat.S_IMODE(opening.parent.stat().st_mode)
        assert mode == (0o600, 0o700)
        assert admitted(said)
        assert ask(port_in(said), path="/wrong")[0].status == 403
        process.send_signal(signal.SIGINT)
        out, errors = process.communicate(timeout=20)
        assert token not in out + errors
    assert not opening.exists()


def test_on_a_terminal_the_whole_address_is_printed(tmp_path):
    (tmp_path / "car.txt").write_bytes(PAPER.read_bytes())
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, "-c", CODE, "view", "--no-browser", "--port", "0", "car.txt"],
        cwd=tmp_path,
        env={"TMPDIR": str(tmp_path), "PYTHONPATH": SEARCH_PATH, "PATH": ""},
        stdout=theirs,
        stderr=subprocess.PIPE,
    )
    try:
        said = b""
        while b"Ctrl-C" not in said:
            said += os.read(ours, 1000)
        pattern = (
            rb"The page is at (http://127\.0\.0\.1:\d+/enter#token=[\w-]{40,}&open=0/car\.txt)"
        )
        assert re.search(pattern, said)
    finally:
        process.kill()
        process.communicate()
        os.close(ours)
        os.close(theirs)


def until(condition) -> None:
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def over(path: Path, request: str) -> str:
    """The answer at a Unix socket."""
    with socket.socket(socket.AF_UNIX) as client:
        client.settimeout(20)
        client.connect(str(path))
        client.sendall(f"{request}\r\nConnection: close\r\n\r\n".encode())
        return b"".join(iter(lambda: client.recv(1 << 16), b"")).decode()


def test_a_unix_socket_is_for_its_owner_alone(tmp_path):
    path = tmp_path / "page.sock"
    with started(tmp_path, "--socket", str(path), "--port", "9000") as (process, said):
        assert f"ssh -L 9000:{path}" in said
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert address_in(said).startswith("http://127.0.0.1:9000/enter#token=")
        assert over(path, "GET / HTTP/1.1\r\nHost: localhost:9000").startswith("HTTP/1.1 403")
        assert "enter.js" in over(path, "GET /enter HTTP/1.1\r\nHost: localhost:9000")
        assert over(path, "GET /enter HTTP/1.1\r\nHost: a.example").startswith("HTTP/1.1 421")
        listed = Path(f"/proc/{process.pid}/net/tcp").read_text().splitlines()[1:]
        own = {str(one.readlink()) for one in Path(f"/proc/{process.pid}/fd").iterdir()}
        assert not [line for line in listed if f"socket:[{line.split()[9]}]" in own]
        process.send_signal(signal.SIGTERM)
        assert process.communicate(timeout=20) == ("Stopped.\n", "")
    assert not path.exists()


def test_a_socket_left_by_a_kill_is_replaced_and_one_in_use_is_not(tmp_path):
    path = tmp_path / "page.sock"
    with unix_socket(path) as listening:
        listening.listen()
        with pytest.raises(InputError, match=r"--socket .*: cannot be used .*: give another path"):
            unix_socket(path)
    assert path.exists()
    unix_socket(path).close()
    path.unlink()
    path.write_text("a file")
    with pytest.raises(InputError, match="give another path"):
        unix_socket(path)
    assert path.read_text() == "a file"
    for wrong in (tmp_path / "missing" / "page.sock", tmp_path / ("x" * 200)):
        with pytest.raises(InputError, match="give another path"):
            unix_socket(wrong)


def test_beyond_loopback_the_address_is_that_of_the_machine(tmp_path):
    with started(tmp_path, "--port", "0", "--host", "0.0.0.0") as (_, said):
        name, port = re.search(r"http://([^/:]+):(\d+)/", said).groups()
        assert name == socket.gethostname()
        assert ask(int(port))[0].status == 403
        assert f"http://{name}:{port}/enter#token=" in address_in(said)


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
    assert address_of(Endpoint("::1"), Guard(80, token="t")) == "http://[::1]:80/enter#token=t"
