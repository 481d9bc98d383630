"""The result as text: the table of the terminal and the detailed report, in the paper's terms."""

from __future__ import annotations

import math

from pipeline.angles import deg_min_sec
from pipeline.measurement import Measurement, WheelResult
from pipeline.report.layout import aligned, equation, number, vector

SIGNS = """\
Toe (convergência): positive is toe-in, on both sides; measured from the normal of the rear axle.
Camber (sopé): positive is top out, on both sides; elevation of the wheel's outward normal, as in
the paper. Camber ISO: projected on the plane across the vehicle (ISO 8855).
Angles in degrees, minutes and seconds of arc; the sign belongs to the whole angle.
u: standard uncertainty (k = 1), from the scatter of the points."""


def summary_table(measurement: Measurement) -> str:
    """Wheel by wheel: toe, camber and ISO camber with their uncertainty, or why there is none."""
    rows: list[tuple[str, ...]] = [("name", "wheel", "toe", "u", "camber", "u", "camber ISO", "")]
    for result in measurement.wheels:
        if result.angles is None:
            rows.append((result.observation.name, result.wheel or "", *["-"] * 5, _why(result)))
            continue
        rows.append(
            (
                result.observation.name,
                result.wheel or "",
                deg_min_sec(result.angles.toe_rad),
                _seconds(result.u_toe_rad),
                deg_min_sec(result.angles.camber_rad),
                _seconds(result.u_camber_rad),
                deg_min_sec(result.angles.camber_iso_rad),
                "",
            )
        )
    return aligned(rows, left=2)


def vehicle_lines(measurement: Measurement) -> str:
    """Total toes, thrust angle, tracks and wheelbase with their uncertainties."""
    vehicle, frame, u = measurement.vehicle, measurement.frame, measurement.uncertainty
    rows = [
        ("rear total toe", deg_min_sec(vehicle.rear_total_toe_rad), _seconds(u.rear_total_toe_rad)),
        (
            "front total toe",
            deg_min_sec(vehicle.front_total_toe_rad),
            _seconds(u.front_total_toe_rad),
        ),
        (
            "thrust angle, + to the right",
            deg_min_sec(vehicle.thrust_angle_rad),
            _seconds(u.thrust_angle_rad),
        ),
        ("rear track", f"{frame.rear_track_m:.5f} m", _millimetres(u.rear_track_m)),
        ("front track", f"{frame.front_track_m:.5f} m", _millimetres(u.front_track_m)),
        ("wheelbase", f"{frame.wheelbase_m:.5f} m", _millimetres(u.wheelbase_m)),
    ]
    return aligned([("", "", "u"), *rows], left=1)


def detailed_report(measurement: Measurement) -> str:
    """The paper's report, for scans as for five points: frame, centres, planes, angles, origin."""
    made = measurement.provenance
    points = sum(wheel.observation.points_total for wheel in measurement.wheels)
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
        SIGNS,
        "",
        summary_table(measurement),
        "",
        vehicle_lines(measurement),
        "",
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
    return [title, aligned(rows, left=1)]


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


def _seconds(angle_rad: float | None) -> str:
    return "-" if angle_rad is None else f'{math.degrees(angle_rad) * 3600:.1f}"'


def _millimetres(length_m: float) -> str:
    return f"{length_m * 1e3:.3f} mm"
