"""What may import what: the order of the stages, the foreign libraries, and a fast --help."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterable
from graphlib import TopologicalSorter
from importlib.machinery import PathFinder
from pathlib import Path

import pytest

from tests.made import write_small_capture

ROOT = Path(__file__).resolve().parents[1]
PAPER = ROOT / "tests" / "data" / "paper" / "figure-4.txt"
CLOUD = ROOT / "pipeline" / "certified" / "pcl" / "sac_plane_test.pcd"

# A module, or a package, may import what stands before it, and nothing else of the project.
LAYERS = [
    "errors",
    "digest",
    "units",
    "blocks",
    "kernels",
    "compiled",
    "passes",
    "cloud_sample",
    "slab_sums",
    "cubes",
    "surfels",
    "distributions",
    "power",
    "york",
    "limits_of_agreement",
    "first_order",
    "vehicle",
    "definitions",
    "ransac",
    "config",
    "plates",
    "printed",
    "targets",
    "tolerance",
    "judge",
    "reference_frame",
    "archive",
    "plausible",
    "readers",
    "survey",
    "oddities",
    "scan_entry",
    "front",
    "capture_file",
    "capture_folder",
    "capture_names",
    "capture_entries",
    "capture_target",
    "capture",
    "raster",
    "trimmed",
    "trimmed_plane",
    "local_planes",
    "candidates",
    "hypotheses",
    "patch",
    "segment",
    "axles",
    "faces",
    "causes",
    "correlation",
    "fit_plane",
    "planes",
    "edge_profile",
    "circle",
    "outline",
    "rim_beams",
    "rim_background",
    "rim_equations",
    "rim_start",
    "rim",
    "face_turn",
    "centres",
    "face_outline",
    "face_view",
    "edge_centre",
    "face_image",
    "features",
    "feature_places",
    "pattern_pose",
    "pattern",
    "locate_centre",
    "face_map",
    "upright",
    "identify_wheels",
    "angles",
    "jacobian",
    "uncertainty",
    "joint_test",
    "other_formulas",
    "monte_carlo",
    "five_point",
    "five_point_file",
    "tcgc_2013",
    "point_causes",
    "measurement",
    "quantities",
    "plate_places",
    "one_axis",
    "repeats",
    "turned",
    "axle_frame",
    "steering",
    "toe_out",
    "runout",
    "conformity",
    "stated_causes",
    "observe",
    "cloud_faces",
    "observe_cloud",
    "observe_capture",
    "align",
    "measure",
    "virtual_five_point",
    "validate_shape",
    "validate_method",
    "validate_compare",
    "validate_match",
    "validate_five",
    "validate_old",
    "validate_truth",
    "validate_request",
    "validate_virtual",
    "validate",
    "validate_scores",
    "agreement",
    "validate_archive",
    "selftest",
    "report",
    "batch",
    "manual",
    "web",
    "commands",
    "cli",
]

# The way of the data; the frame stands before it, since it says what the wheels are called.
FLOW = (
    "capture segment fit_plane locate_centre angles uncertainty align measure report commands cli"
)

HOMES = {
    "open3d": {"synth/raycast.py"},
    "libusb_package": {"synth/raycast.py"},
    "trimesh": {"pipeline/readers/mesh.py", "synth/solids.py"},
    "cv2": {
        "pipeline/features.py",
        "pipeline/raster.py",
        "pipeline/report/drawing_png.py",
        "synth/pattern.py",
    },
    "scipy": {"pipeline/distributions.py"},
    "numba": {"pipeline/compiled.py"},
    "pye57": {"pipeline/readers/child_main.py", "synth/e57.py"},
    "lazrs": {"pipeline/readers/child_main.py"},
    "laspy": set(),
    "markdown_it": {"pipeline/manual/markdown.py"},
    "distributed": {"pipeline/batch/cluster.py"},
    "duckdb": {"pipeline/batch/export.py"},
    "fsspec": {"pipeline/batch/object_storage.py"},
    "openpyxl": {"pipeline/batch/export.py"},
    "rich": {"pipeline/batch/progress.py"},
    "jinja2": {"pipeline/report/html.py", "pipeline/manual/build.py"},
    "weasyprint": {"pipeline/report/pdf.py"},
    "pydantic": {
        "pipeline/config.py",
        "pipeline/plates.py",
        "pipeline/printed.py",
        "pipeline/capture_file.py",
        "pipeline/tolerance.py",
        "synth/parameters.py",
        "synth/recipe.py",
        "synth/pattern_file.py",
        "synth/plate_file.py",
    },
}
HEAVY = {"numpy", "cv2", "pydantic", "open3d", "scipy", "trimesh", "pye57", "lazrs"}


def sources(package: str) -> dict[str, str]:
    """Dotted name of every module of a package, and its text."""
    return {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): (
            path.read_text(encoding="utf-8")
        )
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def imported(text: str, here: str = "") -> set[str]:
    """Dotted names that a module imports, at its top or inside a function, or by a string."""
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{here}: a relative import"
            names.add(node.module)
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in (
            "import_module",
            "__import__",
        ):
            names |= {a.value for a in node.args if isinstance(a, ast.Constant)}
    return names


def graph(texts: dict[str, str]) -> dict[str, set[str]]:
    """Each module, and the modules among `texts` that it imports."""
    return {name: imported(text, name) & set(texts) - {name} for name, text in texts.items()}


def layer(module: str) -> int:
    part = module.split(".")[1]
    assert part in LAYERS, f"{module} has no place in LAYERS: say what it may import"
    return LAYERS.index(part)


def upward(texts: dict[str, str]) -> list[str]:
    """Imports of a later layer by an earlier one."""
    return [
        f"{name} imports {other}"
        for name, others in graph(texts).items()
        for other in others
        if name != "pipeline" and other != "pipeline" and layer(other) > layer(name)
    ]


def strangers(texts: dict[str, str], forbidden: str) -> set[str]:
    return {
        name
        for name, text in texts.items()
        if any(other.split(".")[0] == forbidden for other in imported(text))
    }


def test_no_stage_imports_a_later_one():
    texts = sources("pipeline")
    assert len(texts) > 40
    assert upward(texts) == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("pipeline.kernels", "from pipeline.segment import find_target"),
        ("pipeline.segment", "from pipeline import fit_plane"),
        ("pipeline.readers.ply", "import pipeline.capture"),
        ("pipeline.angles", "def f():\n    from pipeline.measure import measure_scan"),
        ("pipeline.measure", "from pipeline.report.text import summary_table"),
        ("pipeline.report.text", "import importlib\nimportlib.import_module('pipeline.cli')"),
    ],
)
def test_an_upward_import_is_seen(module, line):
    texts = sources("pipeline")
    texts[module] += "\n" + line + "\n"
    assert len(upward(texts)) == 1


def test_a_module_without_a_place_is_seen():
    texts = sources("pipeline") | {"pipeline.novelty": "from pipeline.errors import InputError"}
    with pytest.raises(AssertionError, match=r"pipeline\.novelty has no place"):
        upward(texts)


def test_layers_keep_the_flow_and_name_nothing_that_is_gone():
    flow = [LAYERS.index(stage) for stage in FLOW.split()]
    assert flow == sorted(flow)
    there = {name.split(".")[1] for name in sources("pipeline") if name != "pipeline"}
    assert set(LAYERS) == there
    assert len(set(LAYERS)) == len(LAYERS)


@pytest.mark.parametrize("package", ["pipeline", "synth"])
def test_no_import_goes_round_in_a_circle(package):
    order = list(TopologicalSorter(graph(sources(package))).static_order())
    assert len(order) == len(sources(package))


def test_synth_and_pipeline_share_nothing():
    """One door: the command `synth`, which calls the generator and computes nothing."""
    assert strangers(sources("synth"), "pipeline") == set()
    assert strangers(sources("pipeline"), "synth") == {"pipeline.commands.synth"}
    door = sources("pipeline")["pipeline.commands.synth"]
    assert {name for name in imported(door) if name.startswith("synth")} == {
        "synth.archive",
        "synth.errors",
        "synth.whole",
    }
    assert "numpy" not in imported(door)
    assert "math" not in imported(door)


@pytest.mark.parametrize("library", sorted(HOMES))
def test_a_foreign_library_stays_in_its_file(library):
    texts = sources("pipeline") | sources("synth")
    homes = {f"{name.replace('.', '/')}.py" for name in strangers(texts, library)}
    assert homes == HOMES[library]


def modules_loaded_by(*arguments: str) -> set[str]:
    run = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "pipeline.cli", *arguments],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    lines = [line for line in run.stderr.splitlines() if line.startswith("import time:")]
    return {line.rpartition("|")[2].strip().split(".")[0] for line in lines}


SOUGHT_IF_THERE = {"coverage"}  # by numba, which a file of that name beside a script breaks


def test_no_benchmark_hides_a_module():
    """A script's folder is searched before all libraries."""
    names = {path.stem for path in (ROOT / "tests" / "bench").glob("*.py")}
    libraries = [place for place in sys.path if place.endswith("-packages")]
    taken = {name for name in names if PathFinder.find_spec(name, libraries)}
    assert libraries
    assert len(names) > 10
    assert not taken | names & (set(sys.stdlib_module_names) | SOUGHT_IF_THERE)


def test_help_loads_no_heavy_library():
    loaded = modules_loaded_by("--help")
    assert {"click", "pipeline"} <= loaded
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
        if name.split(".")[0] in {blocked!r}:
            raise ImportError(f"no {{name}} on this machine")
sys.meta_path.insert(0, Missing())
sys.argv = ["wheelplane", *{arguments!r}]
from pipeline.cli import main
main()
"""


def without(blocked: Iterable[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    code = BLOCKED.format(blocked=sorted(blocked), arguments=list(arguments))
    return subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )


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


@pytest.mark.parametrize("blocked", [RAY_CASTING, {"open3d"}, {"libusb_package"}, {"trimesh"}])
def test_synth_says_in_one_line_what_to_install(blocked, tmp_path):
    run = without(blocked, "synth", str(tmp_path / "made"))
    assert run.returncode == 2
    assert run.stdout == ""
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("wheelplane: ")
    assert "pip install" in run.stderr
    assert list(tmp_path.iterdir()) == []
