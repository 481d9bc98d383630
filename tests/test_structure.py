"""What may import what: the order of the stages, the foreign libraries, and a fast --help."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterable
from functools import cache
from graphlib import TopologicalSorter
from importlib.machinery import PathFinder
from pathlib import Path

import pytest

from tests.support.made import write_small_capture
from wheelplane.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
PAPER = ROOT / "tests" / "data" / "paper" / "figure-4.txt"
CLOUD = ROOT / "pipeline" / "diagnostics" / "certified" / "pcl" / "sac_plane_test.pcd"

# A room may import those that stand above it, and none below; a part of a room likewise.
# fmt: off
ROOMS = [
    "errors", "system", "vectors", "units", "config", "files",
    "cloud", "vehicle",
    "targets", "readers",
    "uncertainty", "capture",
    "plane",
    "detection",
    "centre",
    "wheel",
    "diagnostics",
    "measurement",
    "kinematics", "five_point",
    "measure",
    "explanation",
    "validation",
    "calibration",
    "report",
    "library",
    "batch",
    "manual", "web",
    "commands",
    "cli", "__main__",
]
PARTS = {
    "centre": ["edge", "pattern", "."],
    "validation": ["statistics", "."],
    "calibration": ["forms", ".", "certificate"],
    "report": [
        "format",
        "tables",
        "scene",
        "text",
        "json",
        "plots",
        "candidates",
        "html",
        "dcc",
        ".",
    ],
    "commands": ["shared", "."],
    "batch": ["storage", "plan", "catalogue", "operation", "results", "run", "."],
}
# fmt: on
# Rooms that others enter by their door alone, `__init__.py`; renderers and commands are imported
# one by one, so that --help loads none of them.
# fmt: off
DOORS = [
    "system", "cloud", "vehicle", "targets", "readers", "uncertainty", "capture", "plane",
    "detection", "diagnostics", "centre", "wheel", "measurement", "kinematics", "five_point",
    "validation", "calibration", "library", "explanation",
]
# fmt: on
MOST_AT_ROOT, MOST_IN_A_ROOM = 8, 13

HOMES = {
    "open3d": {"synth/scanner/raycast.py"},
    "libusb_package": {"synth/scanner/raycast.py"},
    "trimesh": {"pipeline/readers/formats/mesh.py", "synth/scene/solids.py"},
    "cv2": {"pipeline/cloud/native.py", "synth/scene/pattern.py"},
    "scipy": {
        "pipeline/plane/copies.py",
        "pipeline/plane/find_planes.py",
        "pipeline/plane/thinned/distance_pull.py",
        "pipeline/uncertainty/distributions.py",
    },
    "pye57": {"pipeline/readers/sandbox/worker.py", "synth/output/e57.py"},
    "lazrs": {"pipeline/readers/sandbox/worker.py"},
    "laspy": set(),
    "lxml": {"pipeline/report/dcc/xml.py"},
    "cryptography": {"pipeline/report/signature.py"},
    "markdown_it": {"pipeline/manual/markdown.py"},
    "distributed": {"pipeline/batch/run/cluster.py"},
    "duckdb": {"pipeline/batch/results/export.py", "pipeline/batch/storage/inventory.py"},
    "fsspec": {"pipeline/batch/storage/filesystem.py"},
    "openpyxl": {"pipeline/batch/results/export.py", "pipeline/calibration/forms/table_file.py"},
    "rich": {"pipeline/batch/run/progress.py"},
    "jinja2": {"pipeline/report/html/template.py", "pipeline/manual/build.py"},
    "waitress": {"pipeline/web/listener.py"},
    "weasyprint": {"pipeline/report/html/pdf.py"},
    "pydantic": {
        "pipeline/config.py",
        "pipeline/targets/plates.py",
        "pipeline/targets/pattern_board.py",
        "pipeline/capture/declaration.py",
        "pipeline/calibration/certificate/file.py",
        "pipeline/calibration/forms/item.py",
        "pipeline/calibration/forms/plan_file.py",
        "pipeline/measurement/tolerance/limits.py",
        "pipeline/measurement/tolerance/model.py",
        "synth/parameters/machine.py",
        "synth/parameters/parameters.py",
        "synth/parameters/recipe.py",
        "synth/parameters/pattern_file.py",
        "synth/parameters/plate_file.py",
    },
}
HEAVY = {"numpy", "cv2", "pydantic", "open3d", "scipy", "trimesh", "pye57", "lazrs"}


INSTALLED = {"pipeline": "wheelplane", "synth": "wheelplane_synth"}


def sources(package: str) -> dict[str, str]:
    """Dotted name of every module of a folder, as it is installed, and its text."""
    return {
        ".".join((INSTALLED[package], *path.relative_to(ROOT / package).with_suffix("").parts)): (
            path.read_text(encoding="utf-8")
        )
        for path in sorted((ROOT / package).rglob("*.py"))
    }


@cache
def imported(text: str, here: str = "") -> frozenset[str]:
    """Dotted names that the module `here` imports, at its top or inside a function, or by a string.

    A package is `a.b.__init__` here; what it is imported as is `a.b`.
    """
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            origin = here.split(".")[: -node.level] if node.level else []
            module = ".".join([*origin, *([node.module] if node.module else [])])
            assert node.level or module.split(".")[0] not in here.split(".")[:1], (
                f"{here}: imports its own package by name: use a relative import"
            )
            names.add(module)
            names |= {f"{module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in (
            "import_module",
            "__import__",
        ):
            names |= {a.value for a in node.args if isinstance(a, ast.Constant)}
    return frozenset(names)


@cache
def exported(text: str) -> frozenset[str]:
    """Names that a door exports."""
    return frozenset(
        alias.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    )


def exports(texts: dict[str, str]) -> set[str]:
    """Names that the doors export, dotted: a function may bear the name of its module."""
    return {
        f"{name.removesuffix('.__init__')}.{one}"
        for name, text in texts.items()
        if name.endswith("__init__")
        for one in exported(text)
    }


def graph(texts: dict[str, str]) -> dict[str, set[str]]:
    """Each module, and the modules among `texts` that it imports; packages by their doors."""
    known = {name.removesuffix(".__init__"): name for name in texts}
    of_doors = exports(texts)
    found = {}
    for name, text in texts.items():
        others = {other for other in imported(text, name) if other in known}
        by_door = {o for o in others & of_doors if o.rpartition(".")[0] in others}
        inside = {o for o in by_door if room_of(o) == room_of(name)}
        found[name] = {known[other] for other in others - (by_door - inside)} - {name}
    return found


def room_of(module: str) -> str:
    """The room, or the module at the root, that a module of the pipeline belongs to."""
    return [*module.split("."), "__init__"][1]


def part_of(module: str) -> str:
    """The part of its room that a module belongs to, "." for none."""
    parts = module.split(".")[2:-1]
    return parts[0] if parts else "."


def faults(texts: dict[str, str]) -> list[str]:
    """Imports that go back, or into a room past its door."""
    found = []
    for name, others in graph(texts).items():
        here = room_of(name)
        if here == "__init__":
            continue
        assert here in ROOMS, f"{name} has no place in ROOMS: say what it may import"
        for other in sorted(others):
            there = room_of(other)
            if there == "__init__":
                continue
            door = other == f"wheelplane.{there}.__init__"
            if here == there:
                order = PARTS.get(here, [])
                mine, its = part_of(name), part_of(other)
                back = mine in order and its in order and order.index(its) > order.index(mine)
                if back and not name.endswith("__init__"):
                    found.append(f"{name} imports {other}")
            elif ROOMS.index(there) > ROOMS.index(here):
                found.append(f"{name} imports {other}")
            elif there in DOORS and not door:
                found.append(f"{name} imports {other} past its door")
    return found


def strangers(texts: dict[str, str], forbidden: str) -> set[str]:
    """Modules that import anything of a distribution."""
    return {
        name
        for name, text in texts.items()
        if any(other.split(".")[0] == forbidden for other in imported(text, name))
    }


def file_of(module: str) -> str:
    """Path of a module from the project's root."""
    folder = {installed: folder for folder, installed in INSTALLED.items()}
    first, *rest = module.split(".")
    return "/".join([folder[first], *rest]) + ".py"


def test_rooms_import_in_one_direction_and_by_their_doors():
    texts = sources("pipeline")
    assert len(texts) > 250
    assert faults(texts) == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("vectors", "from .detection import find_target"),
        ("plane.ransac", "from ..centre import locate_centre"),
        ("plane.ransac", "from ..targets.outline import Circle"),
        ("readers.formats.ply", "from ...capture import Capture"),
        ("vehicle.angles", "def f():\n    from ..measure import fit_target"),
        ("measure", "from .report.text.report import summary_table"),
        ("centre.edge.beams", "from ..locate_centre import locate_centre"),
        ("report.text.report", "import importlib\nimportlib.import_module('wheelplane.cli')"),
    ],
)
def test_an_import_that_goes_back_or_past_a_door_is_seen(module, line):
    texts = sources("pipeline")
    texts[f"wheelplane.{module}"] += "\n" + line + "\n"
    assert len(faults(texts)) == 1


def test_an_import_by_the_package_s_own_name_is_seen():
    texts = sources("pipeline")
    texts["wheelplane.measure"] += "\nfrom wheelplane.cloud import sample\n"
    with pytest.raises(AssertionError, match="use a relative import"):
        faults(texts)


def test_a_module_without_a_room_is_seen():
    texts = sources("pipeline") | {"wheelplane.novelty": "from .errors import InputError"}
    with pytest.raises(AssertionError, match=r"wheelplane\.novelty has no place"):
        faults(texts)


def test_rooms_are_those_that_are_there_and_small():
    there = {room_of(name) for name in sources("pipeline")} - {"__init__"}
    assert sorted(ROOMS) == sorted(there)
    assert set(DOORS) < set(ROOMS)
    assert len([name for name in there if (ROOT / "pipeline" / f"{name}.py").is_file()]) <= (
        MOST_AT_ROOT
    )
    for package in INSTALLED:
        for folder in {path.parent for path in (ROOT / package).rglob("*.py")}:
            modules = [path for path in folder.glob("*.py") if path.stem != "__init__"]
            if folder != ROOT / "pipeline" / "commands":
                assert len(modules) <= MOST_IN_A_ROOM, folder
            if folder.name in DOORS and folder.parent.name == "pipeline":
                assert len(modules) >= 4, folder


def test_commands_holds_the_commands_alone():
    modules = {module.split(":")[0].split(".")[-1] for module, _ in COMMANDS.values()}
    there = {path.stem for path in (ROOT / "pipeline" / "commands").glob("*.py")}
    assert there - {"__init__"} == modules


@pytest.mark.parametrize("room", DOORS)
def test_every_module_that_measures_is_imported_by_a_test_of_its_room(room):
    modules = {
        name
        for name in sources("pipeline")
        if room_of(name) == room and not name.endswith("__init__")
    }
    seen = set()
    for path in (ROOT / "tests" / room).glob("test_*.py"):
        seen |= imported(path.read_text(encoding="utf-8"))
    assert modules - seen == set()


@pytest.mark.parametrize("package", sorted(INSTALLED))
def test_no_import_goes_round_in_a_circle(package):
    texts = {n: t for n, t in sources(package).items() if not n.endswith("__init__")}
    order = list(TopologicalSorter(graph(texts)).static_order())
    assert len(order) == len(texts)


def test_synth_and_pipeline_share_nothing():
    """One door: the command `synth`, which calls the generator and computes nothing."""
    assert strangers(sources("synth"), "wheelplane") == set()
    assert strangers(sources("pipeline"), "wheelplane_synth") == {"wheelplane.commands.synth"}
    door = imported(sources("pipeline")["wheelplane.commands.synth"], "wheelplane.commands.synth")
    assert {name for name in door if name.startswith("wheelplane_synth")} == {
        "wheelplane_synth.output.archive",
        "wheelplane_synth.errors",
        "wheelplane_synth.output.whole",
    }
    assert "numpy" not in door
    assert "math" not in door


def test_the_distribution_claims_no_common_name():
    """Only wheelplane is installed; no test or module imports the folders by their own names."""
    for path in (ROOT / "tests").rglob("*.py"):
        names = {name.split(".")[0] for name in imported(path.read_text(encoding="utf-8"))}
        assert not names & set(INSTALLED), path
    for package, name in INSTALLED.items():
        assert (ROOT / ".ci" / "editable" / name).resolve() == ROOT / package
        assert (ROOT / package / "py.typed").is_file()


@pytest.mark.parametrize("library", sorted(HOMES))
def test_a_foreign_library_stays_in_its_file(library):
    texts = sources("pipeline") | sources("synth")
    homes = {file_of(name) for name in strangers(texts, library)}
    assert homes == HOMES[library]


def modules_loaded_by(*arguments: str) -> set[str]:
    run = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "wheelplane", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in run.stderr.splitlines() if line.startswith("import time:")]
    return {line.rpartition("|")[2].strip().split(".")[0] for line in lines}


def test_no_benchmark_hides_a_module():
    """A script's folder is searched before all libraries."""
    names = {path.stem for path in (ROOT / "tests" / "bench").glob("*.py")}
    libraries = [place for place in sys.path if place.endswith("-packages")]
    taken = {name for name in names if PathFinder.find_spec(name, libraries)}
    assert libraries
    assert len(names) > 10
    assert not taken | names & set(sys.stdlib_module_names)


def test_help_loads_no_heavy_library():
    loaded = modules_loaded_by("--help")
    assert {"click", "wheelplane"} <= loaded
    assert loaded & HEAVY == set()
    assert "pydantic" in modules_loaded_by("targets")  # so the list does show what is loaded


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A capture of four coarse scans."""
    return write_small_capture(tmp_path_factory.mktemp("small") / "capture", trials=0)


BLOCKED = """
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in {blocked!r} or name.split(".")[0] in {blocked!r}:
            raise ImportError(f"no {{name}} on this machine")
sys.meta_path.insert(0, Missing())
sys.argv = ["wheelplane", *{arguments!r}]
from wheelplane.cli import main
main()
"""


def without(blocked: Iterable[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    code = BLOCKED.format(blocked=sorted(blocked), arguments=list(arguments))
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_changes_listed_as_equivalent_are_of_lines_that_exist():
    listed = tomllib.loads((ROOT / "tests/bench/equivalent_mutants.toml").read_text())["kind"]
    for kind in listed:
        for file, changes in kind["changes"].items():
            lines = {line.strip() for line in (ROOT / "pipeline" / file).read_text().splitlines()}
            was = [re.sub("«(.*?)→(.*?)»", r"\1", change) for change in changes]
            assert set(was) <= lines, (file, set(was) - lines)
            assert len(set(changes)) == len(changes)


RAY_CASTING = {"open3d", "trimesh", "libusb_package"}


@pytest.mark.parametrize("command", ["measure", "five-point", "plane", "targets"])
def test_measuring_needs_neither_open3d_nor_libusb(command, small, tmp_path):
    arguments = {
        "measure": ("measure", str(small), "-o", str(tmp_path / "out")),
        "five-point": ("five-point", str(PAPER)),
        "plane": ("plane", str(CLOUD)),
        "targets": ("targets",),
    }[command]
    run = without(RAY_CASTING, *arguments)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout


OTHER_WORK = {"wheelplane.five_point", "wheelplane.measurement.tolerance.limits"}


def test_measuring_scans_loads_no_model_of_other_work(small):
    run = without(OTHER_WORK, "measure", str(small), "--json")
    assert (run.returncode, run.stderr) == (0, "")
    assert without(OTHER_WORK, "five-point", str(PAPER)).returncode != 0  # so they are blocked


IN_FORKS = """
import os, sys
here = os.getpid()
def note(event, arguments):
    if event == "import" and os.getpid() != here:
        os.write(2, f"{os.getpid()} {arguments[0]}\\n".encode())  # whole, beside the other
sys.addaudithook(note)
sys.argv = ["wheelplane", "measure", sys.argv[1], "--json"]
from wheelplane.cli import main
main()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")
def test_forked_processes_import_readers_alone_and_each_once(small):
    """All else is imported before they are forked: once, not once in each of them."""
    run = subprocess.run(
        [sys.executable, "-c", IN_FORKS, str(small)],
        cwd=ROOT,
        env=os.environ | {"WHEELPLANE_THREADS": "2"},
        capture_output=True,
        text=True,
        check=True,
    )
    imported = Counter(run.stderr.splitlines())
    assert all(line.split()[1].startswith("wheelplane.readers.") for line in imported)
    assert set(imported.values()) <= {1}


@pytest.mark.parametrize("blocked", [RAY_CASTING, {"open3d"}, {"libusb_package"}, {"trimesh"}])
def test_synth_says_in_one_line_what_to_install(blocked, tmp_path):
    run = without(blocked, "synth", str(tmp_path / "made"))
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("wheelplane: ")
    assert "pip install" in run.stderr
    assert list(tmp_path.iterdir()) == []
