"""The result as text: the table of the terminal and the detailed report, in the paper's terms."""

from __future__ import annotations

import math

import numpy as np

from ...measurement import Conformity, Estimate, Measurement, WheelResult, by_name
from ...vectors import Array
from ..format.digits import rounded
from ..format.earlier import Earlier
from ..format.layout import aligned, equation, paragraph, vector
from ..format.view import DIGITS, PAPER, View
from ..format.writer import Writer
from ..tables.wheels import centres_table, wheels_table
from .budget import budget_text
from .checks import monte_carlo_text, repeats_text
from .conformity import conformity_text
from .kinematics import runout_text, steering_text
from .plain import plain_writer
from .vehicle import axes_text, before_text, vehicle_lines

SIGNS = """\
Toe (convergência): positive is toe-in, on both sides; measured from the longitudinal axis in use.
Camber (sopé): positive where the top leans outward, on both sides; elevation of the wheel's outward
normal, as in the paper, the same for every axis. Camber ISO: projected on the plane across the axis
(ISO 8855).
{units}
u: standard uncertainty (k = 1), by the components of the budget.
{digits}"""


def summary_table(measurement: Measurement, view: View = PAPER) -> str:
    """Return toe, camber and ISO camber of each wheel with u, or why there is none."""
    return wheels_table(measurement, plain_writer(view)).text()


def extra_parts(measurement: Measurement, view: View = PAPER) -> list[str]:
    """Return what only some measurements hold: repeats, sweeps, run-outs, Monte Carlo."""
    drawn = measurement.monte_carlo
    parts = [
        *repeats_text(measurement, view),
        steering_text(measurement, view),
        runout_text(measurement, view),
        monte_carlo_text(measurement, drawn, view) if drawn is not None else "",
    ]
    return [part for part in parts if part]


def detailed_report(
    measurement: Measurement,
    conformity: Conformity | None = None,
    view: View = PAPER,
    before: Earlier | None = None,
) -> str:
    """Return the paper's report: frame, centres, planes, angles, provenance."""
    made, writer = measurement.provenance, plain_writer(view)
    points = sum(measurement.points_read.values())
    sections = [
        f"wheelplane {made.version}: {made.source}" + (f", {made.vehicle}" if made.vehicle else ""),
        f"Points read (pontos lidos): {points} in {len(measurement.wheels)} planes.",
        *measurement.notes,
        "",
        *_frame_section(measurement, writer),
        "",
        *_centre_section(measurement, writer),
        "",
        *_plane_section(measurement),
        "",
        SIGNS.format(units=view.units, digits=DIGITS[view.digits]),
        "",
        summary_table(measurement, view),
        "",
        vehicle_lines(measurement, view),
        "",
        paragraph(writer.words("vehicle.note", side=writer.heading_side)),
        "",
        axes_text(measurement, writer),
        "",
        *([before_text(measurement, before, view), ""] if before else []),
        *(f"{part}\n" for part in extra_parts(measurement, view)),
        budget_text(measurement, view),
        "",
        *([conformity_text(conformity, view), ""] if conformity else []),
        "Made from",
        *(f"  {name}  {digest}" for name, digest in made.inputs.items()),
    ]
    text = "\n".join(sections) + "\n"
    return text.encode(errors="backslashreplace").decode()  # a path may hold bytes that are no text


def _frame_section(measurement: Measurement, writer: Writer) -> list[str]:
    frame, known = measurement.frame, by_name(measurement)
    w = -frame.up
    return [
        "Rear axle (eixo traseiro), coordinates of the input",
        f"  unit vector u, right to left (vector unitário): {vector(frame.left)}",
        f"  middle of the axle: {vector(frame.origin_m, 6)} m",
        f"  rear track (largura): {writer.value(known['rear_track'])}",
        "Front axle (eixo dianteiro)",
        f"  front track (largura): {writer.value(known['front_track'])}",
        "Reference plane (plano de referência), coordinates of the input",
        f"  normal w = u x v, downwards (normal): {vector(w)}",
        f"  equation: {equation(w, -float(w @ frame.origin_m))}",
        "Thrust axis (eixo de impulso), coordinates of the input; normal to the rear axle",
        f"  unit vector v, forwards: {vector(frame.forward)}",
        f"Wheelbase (printed by the paper as distância entre vias): "
        f"{writer.value(known['wheelbase'])}",
    ]


def _centre_section(measurement: Measurement, writer: Writer) -> list[str]:
    title = "Wheel centres (centros das rodas), vehicle frame from the middle of the rear axle, m"
    table = centres_table(measurement, writer)
    ways = (_ways(result, writer) for result in measurement.wheels)
    return [title, table.text(), *filter(None, ways)]


def _ways(result: WheelResult, writer: Writer) -> str:
    """Return the distance of each single method's centre from the combined centre."""
    evidence = result.observation.evidence
    if evidence is None or not evidence.target.others:
        return ""
    centre = evidence.target.centre_m
    offsets = (
        f"{other.method} {_apart(other.centre_m - centre, other.centre_covariance_m2, writer)}"
        for other in evidence.target.others
    )
    return f"  {result.observation.name}: off the combined centre: {', '.join(offsets)}"


def _apart(offset_m: Array, covariance_m2: Array, writer: Writer) -> str:
    u = math.sqrt(max(0.0, float(np.linalg.eigvalsh(covariance_m2)[-1])))
    distance = Estimate(float(np.linalg.norm(offset_m)), u)
    return writer.millimetres(distance.value, distance.expanded)


def _plane_section(measurement: Measurement) -> list[str]:
    rows: list[tuple[str, ...]] = [("", "a", "b", "c", "d / m", "rms / mm", "points")]
    for result in measurement.wheels:
        normal = (result.plate or result).normal
        if normal is not None:
            assert result.observation.evidence is not None
            fitted = result.observation.evidence.target
            coefficients = (rounded(x, -8) for x in normal)
            offset = rounded(-float(normal @ fitted.centre_m), -6)
            rms = f"{fitted.plane_rms_m * 1e3:.4f}"
            rows.append(
                (
                    result.observation.name,
                    *coefficients,
                    offset,
                    rms,
                    f"{fitted.points_on_target} of {result.observation.points_total}",
                )
            )
    title = (
        "Planes (planos de suporte), a x + b y + c z + d = 0, outward unit normal, "
        "coordinates of the input"
    )
    return [title, aligned(rows, left=1)]
