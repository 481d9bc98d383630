"""The result as text: the table of the terminal and the detailed report, in the paper's terms."""

from __future__ import annotations

import numpy as np

from ...measurement import Conformity, Measurement, WheelResult, against, pool_repeats, stated
from ..format.layout import aligned, equation, number, vector
from ..format.view import DEFINED, PAPER, View
from .budget import budget_text
from .conformity import conformity_text
from .monte_carlo import monte_carlo_text
from .repeatability import repeats_text
from .runout import runout_text
from .steering import steering_text
from .vehicle import READING, axes_text, vehicle_lines

SIGNS = """\
Toe (convergência): positive is toe-in, on both sides; measured from the longitudinal axis in use.
Camber (sopé): positive is top out, on both sides; elevation of the wheel's outward normal, as in
the paper, the same for every axis. Camber ISO: projected on the plane across the axis (ISO 8855).
{units}
u: standard uncertainty (k = 1), by the causes of the budget."""


def summary_table(measurement: Measurement, view: View = PAPER) -> str:
    """Wheel by wheel: toe, camber and ISO camber with their uncertainty, or why there is none."""
    chosen = against(stated(measurement), view.axis)
    known = {(quantity.subject, quantity.kind): quantity for quantity in chosen}
    toe = "toe" if view.axis == "rear-axle" else f"toe to {view.axis}"
    rows: list[tuple[str, ...]] = [("name", "wheel", toe, "u", "camber", "u", "camber ISO", "")]
    for result in measurement.wheels:
        name, wheel = result.observation.name, result.wheel or ""
        if result.angles is None:
            rows.append((name, wheel, *["-"] * 5, _why(result)))
            continue
        turned, camber, iso = (known[name, kind] for kind in ("toe", "camber", "camber_iso"))
        rows.append(
            (
                name,
                wheel,
                view.angle(turned.value, "toe"),
                view.width(turned.u, "toe", turned.value),
                view.angle(camber.value, "camber"),
                view.width(camber.u, "camber"),
                view.angle(iso.value, "camber"),
                "",
            )
        )
    return aligned(rows, left=2)


def extra_parts(measurement: Measurement, view: View = PAPER) -> list[str]:
    """What only some measurements hold: repeat scans, sweeps, run-outs, a Monte Carlo check."""
    parts = []
    groups = pool_repeats(measurement)
    if groups:
        parts.append(repeats_text(groups))
        if view.axis != "rear-axle":
            parts.append(f"Pooled toe is counted from the {DEFINED['rear-axle']}.")
    parts += [text for text in (steering_text(measurement), runout_text(measurement)) if text]
    if measurement.monte_carlo is not None:
        parts.append(monte_carlo_text(measurement, measurement.monte_carlo, view.axis))
    return parts


def detailed_report(
    measurement: Measurement, conformity: Conformity | None = None, view: View = PAPER
) -> str:
    """The paper's report, for scans as for five points: frame, centres, planes, angles, origin."""
    made = measurement.provenance
    each = sum(wheel.observation.points_total for wheel in measurement.wheels)
    points = each if made.naming is None else made.naming.points
    sections = [
        f"wheelplane {made.version}: {made.source}" + (f", {made.vehicle}" if made.vehicle else ""),
        f"Points read (pontos lidos): {points} in {len(measurement.wheels)} planes.",
        *measurement.notes,
        "",
        *_frame_section(measurement),
        "",
        *_centre_section(measurement),
        "",
        *_plane_section(measurement),
        "",
        SIGNS.format(units=view.units),
        "",
        summary_table(measurement, view),
        "",
        vehicle_lines(measurement, view),
        "",
        READING,
        "",
        axes_text(measurement, view),
        "",
        *(f"{part}\n" for part in extra_parts(measurement, view)),
        budget_text(measurement, view.axis),
        "",
        *([conformity_text(conformity), ""] if conformity else []),
        "Made from",
        *(f"  {name}  {digest}" for name, digest in made.inputs.items()),
    ]
    text = "\n".join(sections) + "\n"
    return text.encode(errors="backslashreplace").decode()  # a path may hold bytes that are no text


def _frame_section(measurement: Measurement) -> list[str]:
    frame = measurement.frame
    w = -frame.up
    return [
        "Rear axle (eixo traseiro), coordinates of the input",
        f"  unit vector u, right to left (vector unitário): {vector(frame.left)}",
        f"  middle of the axle: {vector(frame.origin_m, 6)} m",
        f"  rear track (largura): {frame.rear_track_m:.5f} m",
        "Front axle (eixo dianteiro)",
        f"  front track (largura): {frame.front_track_m:.5f} m",
        "Reference plane (plano de referência), coordinates of the input",
        f"  normal w = u x v, downwards (normal): {vector(w)}",
        f"  equation: {equation(w, -float(w @ frame.origin_m))}",
        "Thrust axis (eixo de impulso), coordinates of the input; normal to the rear axle",
        f"  unit vector v, forwards: {vector(frame.forward)}",
        f"Wheelbase (printed by the paper as distância entre vias): {frame.wheelbase_m:.5f} m",
    ]


def _centre_section(measurement: Measurement) -> list[str]:
    rows: list[tuple[str, ...]] = [("", "left", "forward", "up", "found by")]
    for result in measurement.wheels:
        if result.angles is not None:
            fitted = result.observation.fitted
            local = measurement.frame.to_vehicle(fitted.centre_m)
            rows.append((result.observation.name, *(number(x, 5) for x in local), fitted.method))
    title = "Wheel centres (centros das rodas), vehicle frame from the middle of the rear axle, m"
    return [title, aligned(rows, left=1), *filter(None, map(_ways, measurement.wheels))]


def _ways(result: WheelResult) -> str:
    """How far the single ways to a combined centre are from it."""
    evidence = result.observation.evidence
    if evidence is None or not evidence.target.others:
        return ""
    centre = evidence.target.centre_m
    told = (
        f"{other.method} {np.linalg.norm(other.centre_m - centre) * 1e3:.3f} mm"
        for other in evidence.target.others
    )
    return f"  {result.observation.name}: off the combined centre: {', '.join(told)}"


def _plane_section(measurement: Measurement) -> list[str]:
    rows: list[tuple[str, ...]] = [("", "a", "b", "c", "d / m", "rms / mm", "points")]
    for result in measurement.wheels:
        if result.normal is not None:
            fitted = result.observation.fitted
            coefficients = (number(x, 8) for x in result.normal)
            offset = number(-float(result.normal @ fitted.centre_m), 6)
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


def _why(result: WheelResult) -> str:
    return f"{result.observation.status}: {result.observation.reason}"
