"""Tests of the manual: commands run and print what it shows, links resolve, and it covers exactly
the options, statuses, notes and fields of the program."""

from __future__ import annotations

import ast
import json
import re
import shlex
from collections.abc import Iterator
from contextlib import closing
from functools import cache, partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import click
import pytest

from tests.support.manual_blocks import (
    ENDLESS,
    OTHERS,
    Command,
    File,
    alike,
    blocks,
    differs,
    folder,
    prepare,
    run,
)
from tests.support.manual_output import updated
from tests.support.manual_reference import NAME, chapter, commands
from wheelplane.batch.catalogue.schema import create
from wheelplane.batch.run.stages import STAGES
from wheelplane.manual.build import chapter_files, pages
from wheelplane.manual.markdown import render
from wheelplane.report.format.language import load_translations

ROOT = Path(__file__).resolve().parents[2]
CHAPTERS = {path.name: path.read_text(encoding="utf-8") for path in chapter_files()}
TROUBLES = CHAPTERS["16-troubleshooting.md"]
# Run, and compared with the shown output, by test_readme.py.
DEMO = "wheelplane demo"
FOREIGN = (
    "--nworkers",
    "--array",
    "--cpus-per-task",
    "--mem",
    "--nthreads",
    "--local-directory",
    "--read-only",
    "--tmpfs",
)  # options of Dask, Slurm and Podman


@pytest.fixture(scope="module")
def scratch(tmp_path_factory):
    """Return a reader's folder with the demo's capture, with fewer points."""
    path = tmp_path_factory.mktemp("reader")
    prepare(path)
    return path


@pytest.mark.slow
def test_every_command_runs_and_prints_the_shown_output(scratch, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(scratch / "cache"))
    monkeypatch.setattr("webbrowser.open", lambda url: True)
    faults = []
    with folder(scratch):
        for one in blocks():
            if isinstance(one, File):
                one.write()
            elif one.line == DEMO:
                faults += located(one, differs(one.shown or "", demo_in_readme()))
            elif ENDLESS.match(one.line):
                faults += located(one, usage_error(one.line))
            elif not one.line.startswith(OTHERS):
                code, printed = run(one.line)
                if code != one.code:
                    message = f"exit code {code}, expected {one.code}: {printed[-300:]}"
                    faults += located(one, message)
                elif one.shown is not None:
                    faults += located(one, differs(one.shown, printed))
    assert not faults, "\n".join(faults)


def located(one: Command, fault: str) -> list[str]:
    return [f"{one.where}: {one.line}: {fault}"] if fault else []


def demo_in_readme() -> str:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.search(r"^```text\n(Making a vehicle .*?)^```$", text, re.MULTILINE | re.DOTALL)[1]


def usage_error(line: str) -> str:
    """Return click's usage error for a command line; empty if there is none."""
    words = shlex.split(line)
    path = max((p for p in commands() if line.startswith(p)), key=len)
    try:
        commands()[path].make_context(path, words[len(path.split()) :])
    except click.UsageError as error:
        return error.format_message()
    return ""


def test_commands_of_cluster_jobs_are_valid():
    """Check the command lines of the blocks that are not run here."""
    jobs = re.findall(r"^```(?:bash|yaml)\n(.*?)^```", "\n".join(CHAPTERS.values()), re.M | re.S)
    lines = re.findall(r"^\s*(wheelplane .+)$", "\n".join(jobs), re.MULTILINE)
    assert len(lines) == 4
    for line in lines:
        assert not usage_error(re.sub(r"\$\(\(.*?\)\)", "1", line)), line


def test_comparison_finds_changed_words_and_numbers():
    printed = 'a table\n  RR  +00°10\'00.0"  12.0"\n  RL  -00°10\'00.0"  12.0"\nthe end\n'
    assert not differs(printed, printed)
    assert not differs("...\nthe end\n", printed)
    assert not differs("a table\n...\n", printed)
    assert not differs('a table\n...\n  RL  -00°10\'01.0"  12.1"\n...\n', printed)
    assert differs("a table\n", printed)
    assert differs("...\nan end\n", printed)
    assert differs(printed.replace("-00°10'00.0", "+00°10'00.0"), printed)
    assert differs(printed.replace("-00°10'00.0", "-00°10'04.0"), printed)
    assert differs(printed.replace("12.0", "13.0"), printed)
    assert differs("...\nthe end\na table\n...\n", printed)
    assert alike("  0.005 mm", "  0.004 mm")
    assert not alike("1 mm", "2 mm")


def test_rewriting_printed_output_keeps_elisions_and_unchanged_lines():
    old = "a table\n...\n  RR  12.0\n  made from x\n...\nend\n"
    new = "A table\nmore\n  RR   12.0\n  synthetic, from x\n  rest\nend\n"
    assert updated(old, new) == "A table\n...\n  RR   12.0\n  synthetic, from x\n...\nend\n"
    assert updated(old, "a table\n  RR  12.01\n  made from x\nend\n") == old
    assert updated("a\n...\n", "b\nc\n") == "b\n...\n"
    for shown in (old, "...\nend\n", "a table\n...\n", new):
        assert not differs(updated(shown, new), new)


def test_chapter_of_commands_matches_click():
    remedy = "run: .venv/bin/python -m tests.support.manual_reference"
    assert CHAPTERS[NAME] == chapter(), remedy


def test_every_named_option_exists():
    known = {"--help", "--version", *FOREIGN}
    for command in commands().values():
        for option in command.params:
            known |= {*option.opts, *option.secondary_opts}
    for name, text in CHAPTERS.items():
        plain = "\n".join(x for x in text.split("\n") if not x.startswith(OTHERS))
        for option in re.findall(r"(?<![\w-])--[a-z][a-z0-9-]+", plain):
            assert option in known, f"{name}: {option}"


class Page(HTMLParser):
    """Parser of a page: anchors, links, loaded files, and violations of the policy."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loads: list[str] = []
        self.faults: list[str] = []
        self.open_script = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        if "id" in known:
            if known["id"] in self.anchors:
                self.faults.append(f"duplicate id {known['id']}")
            self.anchors.add(str(known["id"]))
        if tag == "a":
            self.links.append(str(known["href"]))
        self.loads += [str(known[k]) for k in ("src",) if k in known]
        if tag == "link":
            self.loads.append(str(known["href"]))
        self.faults += [f"<{tag} {k}>" for k in known if k == "style" or k.startswith("on")]
        self.faults += [tag] * (tag == "style")
        self.open_script = tag == "script" and "src" not in known

    def handle_data(self, data: str) -> None:
        if self.open_script and data.strip():
            self.faults.append("inline script")

    def handle_endtag(self, tag: str) -> None:
        self.open_script = False


@cache
def parsed() -> dict[str, Page]:
    return {n: Page(b.decode()) for n, b in pages().items() if n.endswith(".html")}


def test_every_link_anchor_and_picture_resolves():
    files, faults = pages(), []
    for name, page in parsed().items():
        for link in page.links:
            target, _, anchor = link.partition("#")
            target = target or name
            if link.startswith(("http:", "https:")):
                faults.append(f"{name}: {link} leaves the manual")
            elif target not in files:
                faults.append(f"{name}: {link}: no such page")
            elif anchor and anchor not in parsed()[target].anchors:
                faults.append(f"{name}: {link}: no such anchor")
        faults += [f"{name}: {path} is missing" for path in page.loads if path not in files]
    assert not faults, "\n".join(faults)
    assert sum(len(page.links) for page in parsed().values()) > 20 * len(parsed())


def test_pages_are_reproducible_and_self_contained():
    files = pages()
    assert files == pages()
    assert next(iter(files)) == "index.html"
    for name, page in parsed().items():
        assert not page.faults, f"{name}: {page.faults}"
        assert "manual.css" in page.loads
    for name, content in files.items():
        if name.endswith((".css", ".js", ".html")):
            text = content.decode().replace("http://www.w3.org/2000/svg", "")
            assert not re.search(r"(?:src|href|url|import|fetch)\W{0,3}(?:https?:)?//", text), name


def test_every_drawing_is_shown_and_has_a_title():
    shown = {x for text in CHAPTERS.values() for x in re.findall(r"\]\((drawings/\S+)\)", text)}
    existing = {f"drawings/{p.name}" for p in (ROOT / "pipeline/manual/drawings").glob("*.svg")}
    assert shown == existing
    assert all("<title>" in (ROOT / "pipeline/manual" / name).read_text() for name in existing)


def test_markdown_renders_anchors_links_captions_and_escapes_html():
    page = render("# A b!\n[x](03-y.md#z) <b>\n\n```toml f.toml\n<a>\n```\n## `c-d`\ntext", str)
    assert 'id="a-b"' in page.html
    assert 'href="y.html#z"' in page.html
    assert "&lt;b&gt;" in page.html
    assert "<figcaption>f.toml</figcaption>" in page.html
    assert [s.anchor for s in page.sections] == ["a-b", "c-d"]
    assert page.sections[1].text == "text"
    with pytest.raises(AssertionError, match="two headings"):
        render("# A\n## B\n## B\n", str)


CHROMIUM = Path("/usr/bin/chromium")
POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'"


class PolicyHandler(SimpleHTTPRequestHandler):
    """Server of the manual with the content security policy of the local page."""

    def end_headers(self) -> None:
        self.send_header("Content-Security-Policy", POLICY)
        super().end_headers()

    def log_message(self, *args: object) -> None:
        pass


@pytest.mark.slow
@pytest.mark.skipif(not CHROMIUM.is_file(), reason="no browser")
def test_browser_shows_and_searches_it_from_a_folder_and_under_the_policy(tmp_path):
    sync_api = pytest.importorskip("playwright.sync_api")
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    run(f"wheelplane manual --no-browser -o {tmp_path}")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(PolicyHandler, directory=str(tmp_path)))
    Thread(target=server.serve_forever, daemon=True).start()
    addresses = (tmp_path.as_uri(), f"http://127.0.0.1:{server.server_port}")
    try:
        with sync_api.sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=str(CHROMIUM),
                args=["--no-sandbox", "--disable-gpu", "--disable-background-networking"],
            )
            for address in addresses:
                check_in_browser(browser.new_page(), address)
            for scheme in ("light", "dark"):
                page = browser.new_page(color_scheme=scheme)
                for name in ("conventions", "troubleshooting"):
                    page.goto(f"{tmp_path.as_uri()}/{name}.html")
                    assert axe.run(page).response["violations"] == [], f"{name}, {scheme}"
            browser.close()
    finally:
        server.shutdown()
        server.server_close()


def check_in_browser(page: Any, address: str) -> None:
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"{address}/conventions.html")
    # the style sheet of the page applies to the inline drawings
    colour = page.locator("text.f-warm").first.evaluate("e => getComputedStyle(e).fill")
    assert colour == "rgb(184, 64, 12)"
    page.fill("#query", "ambiguous target")
    first = page.locator("#found a").first
    assert "ambiguous-target" in first.inner_text()
    first.click()
    page.wait_for_url("**/troubleshooting.html#ambiguous-target")
    assert page.locator("#ambiguous-target").is_visible()
    page.fill("#query", "xyzzy")
    assert page.locator("#found").inner_text() == "nothing found"
    assert complaints == []


def test_manual_command_writes_the_pages_and_opens_the_first(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(url) or True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    code, printed = run("wheelplane manual")
    first = next(tmp_path.rglob("index.html"))
    assert code == 0
    assert opened == [first.as_uri()]
    assert str(first) in printed
    assert {p.name: p.read_bytes() for p in first.parent.iterdir()} == pages()
    code, _ = run(f"wheelplane manual --no-browser -o {tmp_path / 'there'}")
    assert code == 0
    assert len(opened) == 1
    assert (tmp_path / "there" / "index.html").is_file()
    (tmp_path / "file").touch()
    code, printed = run(f"wheelplane manual --no-browser -o {tmp_path / 'file'}")
    assert code == 2
    assert printed.count("\n") == 1
    assert "-o" in printed


def sources() -> Iterator[tuple[Path, ast.Module]]:
    for path in sorted((ROOT / "pipeline").rglob("*.py")):
        yield path, ast.parse(path.read_text(encoding="utf-8"))


def constants(node: ast.AST) -> list[str]:
    return [
        n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)
    ]


def statuses_of_the_code() -> set[str]:
    """Collect first arguments of NotMeasuredError, values of `status`, and types like Status."""
    found = set()
    for _, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("NotMeasuredError"):
                found |= {a.value for a in node.args[:1] if isinstance(a, ast.Constant)}
            elif isinstance(node, ast.keyword) and node.arg == "status":
                found |= set(constants(node.value) if isinstance(node.value, ast.Constant) else [])
            elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                if re.search(r"(Status|Verdict|Decision|STATUSES)$", node.targets[0].id):
                    found |= set(constants(node.value))
            elif isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "status":
                found |= set(constants(node.annotation))
                found |= set(constants(node.value) if isinstance(node.value, ast.Constant) else [])
    return {text for text in found if re.fullmatch(r"[a-z][a-z -]*[a-z]", text)}


def test_entries_of_statuses_match_the_code():
    known = statuses_of_the_code()
    assert {"no-target", "no-wheel", "moved", "not-reached", "cannot tell", "smaller"} <= known
    entries = re.findall(r"^### `([^`]+)`", TROUBLES, re.MULTILINE)
    assert len(entries) == len(set(entries))
    assert set(entries) == known
    for entry, text in zip(entries, re.split(r"^### `.*$", TROUBLES, flags=re.M)[1:], strict=True):
        assert "**Means:**" in text or entry == "ok", entry
        wrong = re.split(r"^##", text, flags=re.M)[0]
        if entry not in {"ok", "agree", "conform", "as-predicted", "not conform", "cannot tell"}:
            assert "**Do:**" in wrong, entry


def test_every_stage_of_a_batch_has_a_row():
    rows = re.findall(r"^\| `([a-z]+)` \|", TROUBLES.split("| stage |")[1].split("\n\n")[0], re.M)
    assert rows == [*STAGES, "child"]


def test_every_column_of_the_catalogue_is_listed(tmp_path):
    rows = CHAPTERS["14-results.md"].split("| table |")[1].split("\n")
    listed = {re.findall(r"`(\w+)`", row)[0]: re.findall(r"`(\w+)`", row)[1:] for row in rows[2:-1]}
    with closing(create(tmp_path / "catalogue.sqlite")) as catalogue:
        for table in ("captures", "wheels", "quantities"):
            columns = [row[1] for row in catalogue.execute(f"PRAGMA table_info({table})")]
            assert listed[table] == [name for name in columns if name != "id"], table


# Modules and functions that write notes.
NOTES = {
    "assumptions.py": (
        "_note_of_axles", "_note_of_mounting", "_note_of_bare_wheels", "_note_of_centres",
        "_note_of_repeats", "_note_of_z", "_note_of_zeros",
    ),
    "request.py": ("note_of_plates",),
    "evaluate.py": ("_note_of_size", "_notes_of_floor", "_without_a_point"),
    "doubts.py": ("_upside_down", "_far_from_their_wheel", "_unlike_axles", "_copies"),
    "observe_vehicle.py": ("_of_others",),
    "records.py": ("notes",),
    "observe.py": (
        "noisy", "not_as_registered", "not_printed",
        "note_on_hint", "rounded", "thinned", "spaced", "shaded", "broken", "meshed",
        "notes_on_copies", "by_outermost",
    ),
    "plates.py": ("not_as_large", "not_as_thick"),
    "plane.py": ("_coarse",),
    "file.py": ("_note_if_upside_down", "_note_of_sense"),
    "five_point.py": ("note_of_aiming",),
    "tcgc_2013.py": ("by_old_estimator",),
    "plausibility.py": ("float32_fact", "lone_fact"),
    "scans.py": ("_part",),
    "slips.py": ("copying_doubts",),
    "findings.py": ("findings", "_few_points", "_size", "_steps", "_duplicates", "_origin", "_flat",
                    "_pose"),
}  # fmt: skip
SENTENCES = set(load_translations("en").section("note").values())
SENTENCE = 24  # characters; shorter strings are parts of a note


def strings(node: ast.AST) -> Iterator[str]:
    """Yield every string below a node; for an f-string its fixed parts, joined."""
    if isinstance(node, ast.JoinedStr):
        yield "".join(constants_of(node))
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from strings(child)


def constants_of(text: ast.JoinedStr) -> list[str]:
    return [part.value for part in text.values if isinstance(part, ast.Constant)]


def notes_of_the_code() -> dict[str, list[str]]:
    """Return the strings of each function of NOTES, and the sentences in constants."""
    found = {}
    for path, tree in sources():
        constants = {
            target.id: list(strings(node.value))
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.name in NOTES.get(path.name, ()):
                own = [x for x in strings(node) if x != ast.get_docstring(node, False)]
                named = {x.id for x in ast.walk(node) if isinstance(x, ast.Name)}
                said = [text for name in sorted(named) for text in constants.get(name, ())]
                found[f"{path.name}:{node.name}"] = own + [x for x in said if x in SENTENCES]
    return found


def test_entries_of_notes_match_the_code():
    notes = notes_of_the_code()
    assert len(notes) == sum(map(len, NOTES.values()))
    entries = re.findall(r'^### "(.+)"$', TROUBLES, re.MULTILINE)
    everything = " ".join(" ".join(texts) for texts in notes.values())
    for entry in entries:
        assert entry in everything, f"no note contains {entry!r}"
    for function, texts in notes.items():
        for text in texts:
            if len(text) >= SENTENCE:
                assert any(entry in text for entry in entries), f"{function}: {text!r}"


def test_quoted_lines_of_exit_code_2_are_in_the_code():
    everything = "\n".join(text for _, tree in sources() for text in strings(tree))
    rows = TROUBLES.split("| the line says |")[1].split("\n\n")[0].split("\n")[2:]
    for row in rows:
        for quote in re.findall(r"`([^`]+)`", row.split("|")[1]):
            for part in quote.split("..."):
                assert part.strip() in everything, f"no message contains {quote!r}"


def test_notes_are_written_nowhere_else():
    """Require that each function that writes notes is in NOTES, and so in the manual."""
    for path, tree in sources():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and re.match(
                r"_?note_|_?noisy|_?finding", node.name
            ):
                assert node.name in NOTES.get(path.name, ()), f"{path.name}: {node.name}"


def keys(tree: object) -> set[str]:
    if isinstance(tree, dict):
        return set(tree).union(*map(keys, tree.values()))
    return set().union(*map(keys, tree)) if isinstance(tree, list) else set()


def fields_in_tables(text: str) -> set[str]:
    rows = re.findall(r"^\|(.*)\|$", text, re.M)
    return {field for row in rows for field in re.findall(r"`(\w+)`", row)}


def explained(key: str, fields: set[str]) -> bool:
    """Return whether a field, or the one that u_ or expanded_ refers to, is in the tables."""
    bare = re.sub(r"^(u|expanded)_", "", key)
    return bool({key, bare} & fields)


def test_every_field_of_a_measurement_is_explained(scratch):
    fields = fields_in_tables(CHAPTERS["08-json.md"])
    capture = scratch / "demo-output" / "capture"
    code, printed = run(f"wheelplane measure {capture} --tolerance example --json")
    assert code in (0, 1)
    tree = json.loads(printed)
    for free in ("inputs", "config"):  # keys are names of files and settings
        tree["provenance"][free] = None
    for entry in tree["uncertainty"]:
        entry["share_of_variance"] = None
    tree["axes"] = list(tree["axes"].values())
    missing = sorted(key for key in keys(tree) if not explained(key, fields))
    assert not missing
    assert len(keys(tree)) > 100


def test_every_field_of_sweeps_run_outs_repeats_and_monte_carlo_is_explained():
    """Check the dictionary keys in the modules that write them."""
    fields = fields_in_tables(CHAPTERS["08-json.md"])
    for name in (
        "report/json/kinematics.py",
        "report/json/uncertainty.py",
        "batch/run/measure_one.py",
    ):
        tree = ast.parse((ROOT / "pipeline" / name).read_text(encoding="utf-8"))
        written = {
            key.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Dict)
            for key in node.keys
            if isinstance(key, ast.Constant) and isinstance(key.value, str)
        }
        written -= {"rad", "m", "allow_nan", "ensure_ascii", "separators"}  # not fields
        missing = sorted(key for key in written if not explained(key, fields))
        assert not missing, name
