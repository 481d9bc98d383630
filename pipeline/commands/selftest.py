"""Command `wheelplane selftest`: fits of certified data, as a table that a laboratory can file."""

from __future__ import annotations

import json
import math
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import click
import numpy as np

from .. import __version__
from ..diagnostics import BOUND, Check, Figure, digest, run_selftest
from ..report.format.layout import aligned
from ..report.write import write_whole

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "trimesh", "pye57", "laspy", "lazrs")
HEADINGS = {
    "plane": f"Least-squares planes of NIST, bound {BOUND:g} degrees and {BOUND:g} units",
    "clipped-plane": "Same planes, sigma-clipped fit of scans with nothing clipped, same bounds",
    "circle": "Circles of NIST (clipped plane, projection, edge of given diameter), same bounds",
    "scene": "Plane of a real scene of PCL, (a, b, c)/d and points within 0.03 m",
}


@click.command()
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), metavar="FILE", help="File to write to."
)
@click.option("--json", "as_json", is_flag=True, help="Report as JSON.")
def selftest(output: Path | None, as_json: bool) -> int:
    """Fit certified planes and circles, and compare with their certified answers.

    The report has no date: the same program on the same machine writes the same bytes. Exits with 1
    when a bound is not kept.
    """
    checks = tuple(run_selftest())
    report = to_json(checks) if as_json else to_text(checks)
    if output is None:
        click.echo(report, nl=False)
    else:
        click.echo(f"wrote {write_whole(output, report.encode())}: {verdict(checks)}")
    return 0 if all(check.passed for check in checks) else 1


def to_text(checks: tuple[Check, ...]) -> str:
    """Return the conditions, a table for each kind of check, and the verdict as the last line."""
    lines = [f"wheelplane {__version__} selftest", ""]
    lines.append(aligned(list(conditions().items()), left=2))
    for kind, heading in HEADINGS.items():
        alike = [check for check in checks if check.kind == kind]
        rows: list[tuple[str, ...]] = [("data", "points", *map(_title, alike[0].figures), "result")]
        for check in alike:
            result = "pass" if check.passed else "FAIL"
            rows.append((check.name, str(check.points), *map(_value, check.figures), result))
        lines += ["", heading, aligned(rows, left=1)]
    return "\n".join([*lines, "", verdict(checks)]) + "\n"


def to_json(checks: tuple[Check, ...]) -> str:
    """Return the report for programs."""
    tree = {
        "schema": "wheelplane/selftest/1",
        "version": __version__,
        "conditions": conditions(),
        "checks": [
            {
                "kind": check.kind,
                "name": check.name,
                "points": check.points,
                "figures": [_tree(figure) for figure in check.figures],
                "passed": check.passed,
            }
            for check in checks
        ],
        "passed": sum(check.passed for check in checks),
        "total": len(checks),
    }
    return json.dumps(tree, indent=1) + "\n"


def _tree(figure: Figure) -> dict[str, object]:
    """Return the figure's fields; JSON has no NaN, so null stands for it."""
    value = figure.value if math.isfinite(figure.value) else None
    return vars(figure) | {"value": value, "passed": figure.passed}


def conditions() -> dict[str, str]:
    """Return what the figures depend on: data, arithmetic, libraries."""
    blas = np.__config__.CONFIG["Build Dependencies"]["blas"]
    return {
        "data": digest(),
        "arithmetic": f"float64, eps {np.finfo(np.float64).eps!s}, {sys.byteorder}-endian",
        "platform": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        **{name: _version(name) for name in LIBRARIES},
        "linear algebra": f"{blas['name']} {blas['version']}",
    }


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"


def verdict(checks: tuple[Check, ...]) -> str:
    """Return how many checks passed, as a sentence."""
    return f"selftest: {sum(check.passed for check in checks)} of {len(checks)} passed"


def _title(figure: Figure) -> str:
    return f"{figure.name} / {figure.unit}"


def _value(figure: Figure) -> str:
    return f"{figure.value:.2e}" if isinstance(figure.value, float) else str(figure.value)
