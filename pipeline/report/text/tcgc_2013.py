"""The printout of the software of 2013, in its own layout."""

from __future__ import annotations

import math

from ...five_point import Tcgc2013Result
from ...vehicle import deg_min_sec
from ..format.digits import rounded
from ..format.layout import aligned


def tcgc_2013_text(result: Tcgc2013Result) -> str:
    """Write what the software of 2013 printed, in its layout: the report, or the matrix (1).

    Source: the paper; its report prints the rear axle's unit vector again as the thrust axis.
    """
    if result.variant == "matrix":
        return _matrix_2013(result)
    axle = [f"{x:.3g}" for x in result.frame.left]
    names = ["TD", "TE", "FD", "FE", *(str(i) for i in range(1, len(result.toe_rad) - 3))]
    angles = zip(names, result.toe_rad, result.camber_rad, strict=True)
    lines = [
        "Dados eixo traseiro",
        f"vector unit. [{' '.join(axle)}]",
        f"largura {result.frame.rear_track_m:.3g}",
        "Dados do plano de referência",
        f"normal [{' '.join(f'{-x:.3g}' for x in result.frame.up)}]",
        f"eixo impulso [{';'.join(axle)}]",
        f"Distância entre vias {result.frame.wheelbase_m:.3g}",
        "Centros das rodas:",
        "x y z",
        *(" ".join(rounded(x, -3) for x in row) for row in result.centres_vehicle_m[:4]),
        "-----",
        "Ensaio",
        "conv. sopé",
        *(f"{name} {_spaced(toe)} {_spaced(camber)}" for name, toe, camber in angles),
    ]
    return "\n".join(lines) + "\n"


def _spaced(angle_rad: float) -> str:
    text = deg_min_sec(angle_rad, decimals=0)
    return f"{text[0]} {text[1:]}"


def _matrix_2013(result: Tcgc2013Result) -> str:
    """Write a row a block: toe and camber, each as degrees, minutes, seconds (%g)."""
    pairs = zip(result.toe_rad, result.camber_rad, strict=True)
    rows = [(*_parts(toe), *_parts(camber)) for toe, camber in pairs]
    return aligned(rows, left=0) + "\n"


def _parts(angle_rad: float) -> tuple[str, str, str]:
    """Split an angle as the paper does, the sign on the first part that is not zero."""
    total = abs(math.degrees(angle_rad)) * 3600
    degrees, minutes = divmod(int(total // 60), 60)
    parts = [float(degrees), float(minutes), total % 60]
    if angle_rad < 0:
        first = next((i for i, part in enumerate(parts) if part), 2)
        parts[first] = -parts[first]
    return f"{parts[0]:g}", f"{parts[1]:g}", f"{parts[2]:.6g}"
