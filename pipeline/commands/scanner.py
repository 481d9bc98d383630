"""Command `wheelplane scanner`: a scanner's file from its field tests."""

from __future__ import annotations

from pathlib import Path

import click

from ..report.format.layout import aligned
from ..report.write import keep_inputs, write_whole
from ..uncertainty import FieldTests, FoundTerm, evaluate_tests


@click.command()
@click.option(
    "--from",
    "tests",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    metavar="TESTS",
    help="Field test (CSV): two faces of targets, or lengths from point to point; may be repeated.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="Scanner file to write (TOML), for --scanner.",
)
def scanner(tests: tuple[Path, ...], output: Path) -> int:
    """Derive a scanner's file from field tests of it.

    The errors of its axes are found from targets measured in both faces, those of its range from
    known lengths, by least squares. The file states the root of value and u squared of each.
    """
    keep_inputs([output], tests)
    found = evaluate_tests(tests)
    click.echo(as_table(found))
    click.echo(f"wrote {write_whole(output, as_toml(found, tests).encode())}")
    return 0


def as_table(found: FieldTests) -> str:
    """Return the terms with values and u, the names of those not shown, and the notes."""
    rows = [("term", "value", "u", "stated")]
    rows += [(t.key, f"{t.value:+.3g}", f"{t.u:.2g}", _stated(t)) for t in found.terms]
    text = aligned(rows, left=1)
    if found.left_out:
        text += f"\nNot shown by these tests: {', '.join(found.left_out)}."
    return "\n".join([text, *found.notes])


def as_toml(found: FieldTests, tests: tuple[Path, ...]) -> str:
    """Return the scanner's file."""
    lines = [
        f"# Standard uncertainties by wheelplane scanner, from {', '.join(p.name for p in tests)}.",
        "# Add range_sigma_m, spot_radius_m, pointing_urad and registration_m of your scans.",
        "",
        "[instrument]",
        'kind = "laser-scanner"',
    ]
    lines += [f"{t.key} = {_stated(t)} # found {t.value:+.3g}, u {t.u:.2g}" for t in found.terms]
    lines += [f"# {key}: these tests do not show it" for key in found.left_out]
    lines += [f"# {note}" for note in found.notes]
    return "\n".join(lines) + "\n"


def _stated(term: FoundTerm) -> str:
    """Return the number for the file, three digits, as TOML writes it."""
    return repr(float(f"{term.stated:.3g}"))
