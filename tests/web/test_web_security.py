"""Attacks on the page, each refused, beside what a page of ours may do."""

from __future__ import annotations

import io
import tarfile
import zipfile
from contextlib import nullcontext
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from tests.support.web_site import HERE, PAPER, Site, write_results
from wheelplane.errors import InputError
from wheelplane.web.content.measuring import check_inside
from wheelplane.web.files.folders import Folders
from wheelplane.web.security import KEY_HEADER, RefusedError, guard_for, is_loopback
from wheelplane.web.server import address_of
from wheelplane.web.settings import Endpoint

SECRET = "the secret of another folder"
DISC = {"options": {"target": "disc-250"}}


@pytest.fixture
def site(tmp_path):
    made = Site(tmp_path)
    made.copy(PAPER, "figure-4.txt")
    (tmp_path / "secret.txt").write_text(SECRET)
    yield made
    made.close()


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A site that has measured the paper's file, and the job."""
    made = Site(tmp_path_factory.mktemp("measured"))
    made.copy(PAPER, "figure-4.txt")
    yield made, made.measure({"root": 0, "path": "figure-4.txt"})["id"]
    made.close()


# Hosts, origins, keys


@pytest.mark.parametrize(
    ("headers", "code"),
    [
        ({}, 200),
        ({"Host": "localhost:8765"}, 200),
        ({"Host": "127.0.0.1:8766"}, 421),
        ({"Host": "127.0.0.1"}, 421),
        ({"Host": "evil.example:8765"}, 421),
        ({"Host": "127.0.0.1.evil.example:8765"}, 421),
        ({"Host": "evil.example"}, 421),
        ({"Host": "192.168.1.7:8765"}, 421),
        ({"Host": ""}, 421),
        ({"Origin": f"http://{HERE}"}, 200),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://127.0.0.1:1234"}, 403),
        ({"Origin": f"https://{HERE}"}, 403),
        ({"Sec-Fetch-Site": "same-origin"}, 200),
        ({"Sec-Fetch-Site": "none"}, 200),
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site"}, 403),
    ],
)
@pytest.mark.parametrize("path", ["/", "/static/page.css", "/api/files/0/", "/api/session"])
def test_only_this_server_by_its_own_name_and_from_its_own_page(site, path, headers, code):
    if path == "/api/session":
        answer = site.post(path, {"token": site.guard.token}, headers=headers)
        assert answer.status_code == {200: 204}.get(code, code)
        assert ("Set-Cookie" in answer.headers) == (code == 200)
    else:
        assert site.get(path, headers=headers).status_code == code


@pytest.mark.parametrize("site_of_link", ["cross-site", "same-site", "same-origin", "none"])
def test_a_file_of_the_user_s_may_lead_to_the_entry(site, site_of_link):
    """It holds no data, and the page behind it opens with the token only."""
    headers = {"Sec-Fetch-Site": site_of_link}
    assert site.get("/enter", headers=headers).status_code == 200
    assert site.get("/enter", headers=headers | {"Host": "evil.example"}).status_code == 421
    assert site.post("/enter", {}, headers={"Sec-Fetch-Site": "cross-site"}).status_code == 403


def test_a_request_without_the_cookie_learns_nothing(site):
    site.as_a_stranger()
    for path in (
        "/",
        "/?token=x",
        f"/?token={site.guard.token}",
        "/api/files/0/",
        "/api/folders",
        f"/api/folders?token={site.guard.token}",
        "/api/jobs/x",
        "/manual/",
        "/static/../api/folders",
    ):
        answer = site.get(path)
        assert answer.status_code in (403, 404), path
        assert "Set-Cookie" not in answer.headers
        for secret in ("figure-4", site.guard.key, site.guard.session, site.guard.token):
            assert secret not in answer.text + str(answer.headers)
    for path in ("/enter", "/static/app.js", "/static/enter.js", "/viewer.js"):
        answer = site.get(path)
        assert answer.status_code == 200, path
        for secret in (site.guard.key, site.guard.session, site.guard.token):
            assert secret not in answer.text + str(answer.headers)


@pytest.mark.parametrize("token", ["", None, "x", {}, [], 0, "\ud800", "é" * 40])
def test_no_other_token_is_exchanged(site, token):
    site.as_a_stranger()
    answer = site.post("/api/session", {"token": token})
    assert answer.status_code == 403
    assert "Set-Cookie" not in answer.headers


def test_the_token_is_exchanged_for_the_cookie(site):
    site.as_a_stranger()
    site.client.set_cookie("another", "cookie", domain="127.0.0.1")
    answer = site.ask("POST", "/api/session", {KEY_HEADER: None}, json={"token": site.guard.token})
    assert answer.status_code == 204
    assert site.guard.token not in answer.text + str(answer.headers)
    cookie = answer.headers["Set-Cookie"]
    assert "SameSite=Strict" in cookie
    assert "HttpOnly" in cookie
    assert site.get("/").status_code == 200
    assert site.get("/api/folders").status_code == 200


def test_pages_at_two_ports_of_a_machine_leave_each_other_alone(tmp_path):
    sites = [Site(tmp_path / str(port), port=port) for port in (8765, 8766)]
    answers = [site.post("/api/session", {"token": site.guard.token}) for site in sites]
    job_state = [answer.headers["Set-Cookie"].split(";")[0] for answer in answers]
    names = [cookie.partition("=")[0] for cookie in job_state]
    kept = dict(
        zip(names, job_state, strict=True)
    )  # as a browser keeps them: one of a name for a host
    for site in sites:
        bare = site.app.test_client(use_cookies=False)
        headers = {"Host": f"127.0.0.1:{site.guard.port}", "Cookie": "; ".join(kept.values())}
        assert bare.get("/api/folders", headers=headers).status_code == 200
        site.close()


@pytest.mark.parametrize("key", [None, "", "x", "ключ"])
@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("POST", "/api/uploads"),
        ("POST", "/api/measure"),
        ("POST", "/api/language/pt"),
        ("PUT", "/api/uploads/x/rr.ply"),
        ("DELETE", "/api/jobs/x"),
    ],
)
def test_what_changes_something_needs_the_key_of_the_page(site, method, path, key):
    header = None if key is None else key.encode().decode("latin-1")
    answer = site.ask(method, path, headers={KEY_HEADER: header}, json={})
    assert answer.status_code == 403
    assert "key" in answer.json["error"]


def test_a_form_of_another_site_is_refused_even_with_the_cookie(site):
    headers = {KEY_HEADER: None, "Origin": "http://evil.example"}
    form = site.ask("POST", "/api/measure", headers=headers, data={"path": "figure-4.txt"})
    assert form.status_code == 403


def test_every_answer_forbids_foreign_content(site):
    for path in ("/", "/enter", "/static/page.css", "/viewer.js", "/api/files/0/", "/nothing",
                 "/manual/"):  # fmt: skip
        headers = site.get(path).headers
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "http" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert "Access-Control-Allow-Origin" not in headers


def test_the_page_holds_no_inline_script_or_style(site):
    text = site.get("/").text
    assert "<style" not in text
    assert " style=" not in text
    assert " onclick" not in text
    scripts = text.split("<script")[1:]
    assert scripts
    assert all("src=" in s.split(">")[0] or "application/json" in s.split(">")[0] for s in scripts)


def test_everyone_needs_a_token_and_each_server_has_its_own():
    loopback = ["127.0.0.1", "::1", "localhost"]
    network = ["0.0.0.0", "::", "192.168.1.7", "workshop.example", "127.0.0.1.example"]
    assert [host for host in (*loopback, *network) if is_loopback(host)] == loopback
    tokens = {guard_for(host, 1).token for host in (*loopback, *network)}
    assert len(tokens) == len(loopback) + len(network)
    assert min(map(len, tokens)) >= 40
    assert [h for h in (*loopback, *network) if guard_for(h, 1).addresses] == network


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1", "127.0.0.2", "localhost", "::1", "0:0:0:0:0:0:0:1", "192.168.1.7", "Car-1"],
)
def test_the_address_that_is_printed_is_answered(host):
    guard = guard_for(host, 8765)
    called = urlsplit(address_of(Endpoint(host), guard)).netloc
    guard.check("GET", "/", {"Host": called}, "")
    guard.check("GET", "/", {"Host": called, "Origin": f"http://{called}"}, "")
    with pytest.raises(RefusedError):
        guard.check("GET", "/", {"Host": f"x{called}"}, "")


@pytest.mark.parametrize("host", ["localhost", "localhost:8765", "127.0.0.1:9000", "[::1]:80"])
def test_any_port_may_be_forwarded_to_a_unix_socket(host):
    guard = guard_for("127.0.0.1", None)
    guard.check("GET", "/", {"Host": host, "Origin": f"http://{host}"}, "")
    for other in ("evil.example:8765", "192.168.1.7:8765", "evil.example", ""):
        with pytest.raises(RefusedError):
            guard.check("GET", "/", {"Host": other}, "")


def test_no_name_of_another_machine_leads_to_a_server_open_to_the_network():
    guard = guard_for("0.0.0.0", 8765)
    for host in ("192.168.1.7:8765", "[fe80::1]:8765", "localhost:8765"):
        guard.check("GET", "/", {"Host": host}, "")
    for host in ("evil.example:8765", "192.168.1.7:80", "192.168.1.7.evil.example:8765"):
        with pytest.raises(RefusedError):
            guard.check("GET", "/", {"Host": host}, "")


# Paths


ESCAPES = [
    "..",
    "../secret.txt",
    "../../etc/passwd",
    "sub/../../secret.txt",
    "/etc/passwd",
    "//etc/passwd",
    "..\\secret.txt",
    "%2e%2e/secret.txt",
    "%2e%2e%2fsecret.txt",
    "..%2fsecret.txt",
    "%252e%252e%252fsecret.txt",
    "....//secret.txt",
    "./.././secret.txt",
    "figure-4.txt/../../secret.txt",
    "figure-4.txt\0",
    "link.txt",
    "linked",
    "linked/secret.txt",
    "loop",
    "a" * 5000,
]


@pytest.fixture
def escapes(site, tmp_path):
    """The site with links out of its folder, and one that leads round."""
    (site.allowed / "sub").mkdir()
    (site.allowed / "link.txt").symlink_to(tmp_path / "secret.txt")
    (site.allowed / "linked").symlink_to(tmp_path)
    (site.allowed / "loop").symlink_to(site.allowed / "loop")
    return site


@pytest.mark.parametrize("path", ESCAPES)
def test_no_path_leaves_the_allowed_folder(escapes, path):
    answer = escapes.post("/api/measure", {"root": 0, "path": path})
    assert answer.status_code in (400, 403, 404)
    for address in (f"/api/files/0/{path}", f"/api/archive/overview/0/{path}"):
        answer = escapes.get(address, follow_redirects=True)
        assert answer.status_code in (400, 403, 404), address
        assert SECRET not in answer.text


def test_what_lies_inside_is_found(escapes):
    folders = Folders((escapes.allowed.resolve(),))
    assert folders.existing(0, "sub/../figure-4.txt") == escapes.allowed / "figure-4.txt"
    names = [item.name for item in folders.listing(0, "").items]
    assert names == ["sub", "figure-4.txt"]


@pytest.mark.parametrize("root", [-1, 1, 99, "0", None, [0], 0.0])
def test_no_other_root(site, root):
    answer = site.post("/api/measure", {"root": root, "path": "figure-4.txt"})
    assert answer.status_code == 404


@pytest.mark.parametrize(
    "line",
    [
        'RR = "../../secret.txt"',
        'RR = "/etc/passwd"',
        'RR = "link.ply"',
        'RR = "linked/secret.txt"',
    ],
)
def test_a_capture_names_nothing_beyond_the_allowed_folder(site, tmp_path, line):
    capture = site.allowed / "capture"
    capture.mkdir()
    (capture / "link.ply").symlink_to(tmp_path / "secret.txt")
    (capture / "linked").symlink_to(tmp_path)
    others = "\n".join(f'{wheel} = "../figure-4.txt"' for wheel in ("RL", "FR", "FL"))
    (capture / "capture.toml").write_text(f'target = "disc-250"\n[reference]\n{line}\n{others}\n')
    job_state = site.measure({"root": 0, "path": "capture"})
    assert job_state["state"] == "failed"
    assert "outside the allowed folder" in job_state["failure"]["text"]
    assert SECRET not in str(job_state)


@pytest.mark.parametrize("key", ["target", "scanner", "cloud"])
def test_nor_do_its_settings(tmp_path, monkeypatch, key):
    capture = tmp_path / "allowed" / "capture"
    capture.mkdir(parents=True)
    (tmp_path / "secret.toml").write_text("secret = 1")
    (capture / "capture.toml").write_text(f'{key} = "../../secret.toml"\n')
    monkeypatch.chdir(tmp_path / "allowed")
    with pytest.raises(InputError, match="outside the allowed folder"):
        check_inside(Path("capture"), tmp_path / "allowed")
    (capture / "capture.toml").write_text(f'{key} = "../own.toml"\n')
    check_inside(Path("capture"), tmp_path / "allowed")


@pytest.mark.parametrize("kind", ["trial", "sweep", "runout"])
def test_nor_do_its_further_scans(tmp_path, kind):
    more = {"sweep": 'wheel = "FL"\n', "runout": 'wheel = "FL"\nangle_deg = 0\n'}.get(kind, "")
    wheels = "\n".join(f'{wheel} = "{wheel}.ply"' for wheel in ("RR", "RL", "FR", "FL"))
    for file, refused in (("../../secret.ply", True), ("../own.ply", False)):
        capture = tmp_path / "allowed" / "capture"
        capture.mkdir(parents=True, exist_ok=True)
        text = f'[reference]\n{wheels}\n[[{kind}]]\nname = "1"\nfile = "{file}"\n{more}'
        (capture / "capture.toml").write_text(text)
        context = pytest.raises(InputError, match="outside") if refused else nullcontext()
        with context:
            check_inside(capture, tmp_path / "allowed")


def test_nor_does_whatever_else_a_capture_may_come_to_name(tmp_path, monkeypatch):
    monkeypatch.setattr("wheelplane.web.content.measuring.files_of", lambda _: ["../new.kind"])
    (tmp_path / "capture.toml").write_text('cloud = "all.ply"\n')
    with pytest.raises(InputError, match="outside the allowed folder"):
        check_inside(tmp_path, tmp_path)


def test_scans_by_their_names_may_be_no_links_to_elsewhere(site, tmp_path):
    capture = site.allowed / "capture"
    capture.mkdir()
    for wheel in ("rr", "rl", "fr", "fl"):
        (capture / f"{wheel}.xyz").symlink_to(tmp_path / "secret.txt")
    job_state = site.measure({"root": 0, "path": "capture", **DISC})
    assert "outside the allowed folder" in job_state["failure"]["text"]


@pytest.mark.parametrize(
    "options",
    [
        {"target": "/etc/passwd"},
        {"target": "../secret.toml"},
        {"scanner": "secret.toml"},
        {"tolerance": "../example"},
        {"unknown": "1"},
        {"front": "1,2"},
        {"front": "nan,0,0"},
        {"length_unit": ["m"]},
        "text",
    ],
)
def test_options_are_known_names_and_numbers(site, options):
    given = {"root": 0, "path": "figure-4.txt", "options": options}
    assert site.post("/api/measure", given).status_code == 400


# Uploads


@pytest.mark.parametrize(
    "name",
    [
        "../rr.ply",
        "a/../../rr.ply",
        "..%2f..%2frr.ply",
        "/etc/rr.ply",
        ".hidden.ply",
        "a\\b.ply",
        "rr.ply%00.txt",
        "<img src=x onerror=alert(1)>.ply",
        "a:b.ply",
        "\u202egpj.ply",
        "new%0aline.ply",
        "a/b/c/d/e.ply",
        "x" * 200 + ".ply",
    ],
)
def test_uploaded_names_are_plain(site, name):
    upload = site.send()
    answer = site.put(f"/api/uploads/{upload}/{name}", b"1 2 3")
    assert answer.status_code in (400, 404, 308)
    scratch = site.allowed.parent / "scratch"
    assert [p for p in scratch.rglob("*") if p.is_file()] == []


@pytest.mark.parametrize("name", ["run.sh", "page.html", "a.svg", "a.ply.exe", "capture.yaml", "x"])
def test_uploads_of_other_kinds_are_refused(site, name):
    assert site.put(f"/api/uploads/{site.send()}/{name}", b"1").status_code == 415


def test_uploads_are_limited_in_size_and_number(tmp_path):
    site = Site(tmp_path, upload_bytes=1000, upload_files=3)
    try:
        assert site.put(f"/api/uploads/{site.send()}/rr.ply", bytes(1001)).status_code == 413
        upload = site.send(rr__ply=bytes(600))
        assert site.put(f"/api/uploads/{upload}/rl.ply", bytes(600)).status_code == 413
        assert site.put(f"/api/uploads/{upload}/rr.ply", b"1").status_code == 409
        assert site.put(f"/api/uploads/{upload}/RR.ply", b"1").status_code == 409
        assert site.put(f"/api/uploads/{upload}/rr.ply/a.ply", b"1").status_code == 409
        assert site.put(f"/api/uploads/{upload}/fr.ply", None).status_code == 411
        full = site.send(a__ply=b"1", b__ply=b"1", c__ply=b"1")
        assert site.put(f"/api/uploads/{full}/d.ply", b"1").status_code == 413
        assert site.put("/api/uploads/none/d.ply", b"1").status_code == 404
    finally:
        site.close()


def test_an_upload_that_breaks_off_leaves_nothing(site):
    upload = site.send()
    for name in ("rr.ply", "rr.ply/folder/a.ply"):
        with pytest.raises(RefusedError, match="ended 91 bytes too early"):
            site.app.config["state"].uploads.add(upload, name, io.BytesIO(b"only this"), 100)
    scratch = site.allowed.parent / "scratch"
    assert [p for p in scratch.rglob("*") if p.is_file()] == []
    assert site.put(f"/api/uploads/{upload}/rr.ply", b"1").status_code == 200


def test_what_was_not_stored_counts_for_nothing(tmp_path):
    site = Site(tmp_path, upload_bytes=100, upload_files=1)
    upload, uploads = site.send(), site.app.config["state"].uploads
    for said, declared in (
        ("too early", 100),
        ("larger than", 101),
        ("does not state its size", None),
    ):
        with pytest.raises(RefusedError, match=said):
            uploads.add(upload, "rr.ply", io.BytesIO(b"only this"), declared)
    assert site.post("/api/measure", {"upload": upload}).status_code == 400  # it holds no file
    assert site.put(f"/api/uploads/{upload}/rr.ply", bytes(100)).status_code == 200
    site.close()


def test_other_requests_are_small(site):
    answer = site.post("/api/measure", {"root": 0, "path": "x" * 200_000})
    assert answer.status_code in (400, 413)


@pytest.mark.parametrize(
    "data",
    [b"", b"[]", b'"text"', b"{", b"\xff\xfe", b'{"upload": 3}', b'{"root": {}}', b"null",
     b"[" * 100_000, b'{"a":' * 20_000, b"[" * 50_000 + b"]" * 50_000, b"9" * 90_000,
     b'{"root": ' + b"9" * 5000 + b"}", b'{"root": 1e999, "path": "\\ud800"}',
     b'{"root": 0, "path": "\\ud800"}', b'{"root": 0, "path": ["a"]}'],
)  # fmt: skip
def test_malformed_requests_are_reported_as_such(site, data):
    for path in ("/api/measure", "/api/compare", "/api/session"):
        answer = site.ask("POST", path, data=data, content_type="application/json")
        assert answer.status_code in (400, 403, 404), path
        assert answer.json["error"]


ODD = [
    "", "%0d%0a", "a%0d%0aSet-Cookie:%20x=1", "%00", "%ff%fe", "..", "%2e%2e%2fx", "'", '"', "%5c",
    "%ed%a0%80", "%F0%9F%98%80", "-1", "9" * 30, "1e999", "nan", "x" * 3000, "[", "{}", "%", "*",
    "%c2%b9", "%d9%a3", "%e2%80%ae", "1.5",
]  # fmt: skip
ASKED = [
    "/api/files/0/{}",
    "/api/files/{}/",
    "/api/jobs/{}/measurement.json",
    "/api/jobs/{job}/{}",
    "/api/jobs/{job}/report.{}",
    "/api/jobs/{job}/report.txt?download&name={}",
    "/api/jobs/{job}/report.txt?language={}",
    "/api/jobs/{job}/report.txt?axis={}",
    "/manual/{}",
    "/static/{}",
    "/api/archive/{}/0/results",
    "/api/archive/captures/0/results?offset={}",
    "/api/archive/captures/0/results?status={}",
    "/api/archive/captures/0/results?key={}",
    "/api/archive/captures/0/results?text={}",
    "/api/archive/trends/0/results?vehicle={}",
    "/api/archive-plot/0/results?quantity={}",
]


@pytest.fixture(scope="module")
def batched(measured):
    """The site with the results of a batch."""
    site, job = measured
    write_results(site.allowed / "results", site.get(f"/api/jobs/{job}/measurement.json").json)
    return measured


@pytest.mark.parametrize("asked", ASKED)
def test_odd_addresses_are_the_client_s_fault(batched, asked):
    """Of 14,199 such requests four kinds ended as errors of the server: names with line ends,
    offsets beyond 64 bits or in superscript."""
    site, job = batched
    for odd in ODD:
        answer = site.get(asked.replace("{job}", job).replace("{}", odd))
        assert answer.status_code < 500, (odd, answer.text)
        assert "\n" not in str(answer.headers.get("Content-Disposition", ""))
        assert "Set-Cookie" not in answer.headers


def test_a_report_is_downloaded_under_a_plain_name_only(batched):
    site, job = batched
    address = f"/api/jobs/{job}/report.txt?download&name="
    assert "my car.txt" in site.get(f"{address}my%20car.txt").headers["Content-Disposition"]
    for name in ("a%0d%0aX-Evil:1", "a%0ab", "a/b", "..%2fa", "%22", "%00", ".a", "x" * 200):
        answer = site.get(address + name)
        assert answer.status_code == 400, name
        assert "is not a valid file name" in answer.json["error"]


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("junk.ply", b"\x00\xff" * 500),
        ("short.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 1000000\n"),
        ("junk.e57", b"ASTM-E57" + bytes(4000)),
        ("junk.zip", b"PK\x03\x04" + bytes(200)),
        ("junk.tar.gz", b"\x1f\x8b" + bytes(200)),
        ("huge.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, "
         b"'shape': (900000000000, 3), }" + b" " * 40 + b"\n"),
    ],
)  # fmt: skip
def test_malformed_files_end_in_one_line(site, name, data):
    upload = site.send(**{name.replace(".", "__"): data})
    job_state = site.measure({"upload": upload, **DISC})
    assert job_state["state"] == "failed"
    text = job_state["failure"]["text"]
    assert name in text
    assert "\n" not in text
    assert "internal error" not in text
    assert str(site.allowed.parent) not in text


def zip_of(members: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return out.getvalue()


def test_a_zip_bomb_is_refused_before_it_is_unpacked(site):
    bomb = zip_of({f"{wheel}.xyz": b"0 0 0\n" * (50 << 20) for wheel in ("rr",)})
    # Many members that share one body: 1.5 GB declared in a small file.
    bomb = declared_larger(bomb, 1 << 31)
    job_state = site.measure({"upload": site.send(bomb__zip=bomb), **DISC})
    assert job_state["state"] == "failed"
    assert (
        "unpacks to" in job_state["failure"]["text"] or "unpacked" in job_state["failure"]["text"]
    )
    assert stored(site) < 10 << 20


def declared_larger(data: bytes, size: int) -> bytes:
    """The zip with a larger unpacked size in its directory."""
    at = data.rindex(b"PK\x01\x02") + 24
    return data[:at] + size.to_bytes(4, "little") + data[at + 4 :]


def stored(site: Site) -> int:
    scratch = site.allowed.parent / "scratch"
    return sum(path.stat().st_size for path in scratch.rglob("*") if path.is_file())


def test_an_archive_whose_members_point_outside_is_refused(site):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        info = tarfile.TarInfo("../../escaped.ply")
        info.size = 3
        archive.addfile(info, io.BytesIO(b"ply"))
    for name, data in (("evil.tar", out.getvalue()), ("evil.zip", zip_of({"../x.ply": b"ply"}))):
        job_state = site.measure({"upload": site.send(**{name.replace(".", "__"): data})})
        assert "points outside" in job_state["failure"]["text"], name


def test_what_takes_too_long_is_stopped(tmp_path):
    site = Site(tmp_path, seconds=0.05)
    try:
        site.copy(PAPER, "figure-4.txt")
        job_state = site.measure({"root": 0, "path": "figure-4.txt"})
        assert job_state["state"] == "failed"
        assert "longer than 0.05 s" in job_state["failure"]["text"]
        assert "--time-limit" in job_state["failure"]["text"]
    finally:
        site.close()


def test_what_takes_too_much_memory_is_reported(tmp_path):
    site = Site(tmp_path, memory_bytes=100 << 20)
    try:
        out = io.BytesIO()
        np.save(out, np.zeros((5_000_000, 3), np.float32))
        job_state = site.measure({"upload": site.send(a__npy=out.getvalue())} | DISC)
        assert job_state["state"] == "failed"
        assert "memory" in job_state["failure"]["text"]
    finally:
        site.close()


# Names that hold script


def test_scripts_in_names_stay_text(tmp_path):
    site = Site(tmp_path)
    name = "<script>alert(1)<script>.txt"
    (site.allowed / name).write_bytes(PAPER.read_bytes())
    try:
        job_state = site.measure({"root": 0, "path": name})
        assert job_state["state"] == "done"
        report = site.get(f"/api/jobs/{job_state['id']}/report.html")
        assert report.status_code == 200
        assert "<script>alert" not in report.text
        policy = report.headers["Content-Security-Policy"]
        assert policy.startswith("sandbox ")
        assert "allow-same-origin" not in policy
        assert "connect-src" not in policy  # so default-src 'none' holds
        assert site.get("/").text.count("alert(1)") == 0
    finally:
        site.close()


def test_reports_are_saved_under_plain_names_only(measured):
    site, job = measured
    for name in ("../x.txt", "a/b.txt", "", " ", ".x", "a\0.txt", "con:.txt", "x" * 200):
        given = {"format": "txt", "root": 0, "name": name}
        answer = site.post(f"/api/jobs/{job}/save", given)
        assert answer.status_code in (400, 403), name
    answer = site.post(f"/api/jobs/{job}/save", {"format": "txt", "root": 1, "name": "a.txt"})
    assert answer.status_code == 404
    answer = site.post(
        f"/api/jobs/{job}/save", {"format": "txt", "root": 0, "path": "..", "name": "a.txt"}
    )
    assert answer.status_code == 403


def test_of_a_job_only_its_results_are_given_out(measured):
    site, job = measured
    assert site.get(f"/api/jobs/{job}/measurement.json").status_code == 200
    hidden = "measurement.pickle", "log.txt", "..%2f..%2fsecret.txt", "panel-..%2flog.txt", ".."
    for file in hidden:
        assert site.get(f"/api/jobs/{job}/{file}").status_code == 404, file
    assert site.get("/api/jobs/../measurement.json").status_code == 404
