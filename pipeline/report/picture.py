"""A picture of a target's face: residuals in colour, the fitted outline and centre over them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipeline.face_map import FaceMap
from pipeline.measurement import WheelResult

Image = npt.NDArray[np.uint8]
SCALE = 3  # pixels a cell
MARGIN = 70
FULL_SIGMAS = 3.0


def face_png(result: WheelResult) -> bytes | None:
    """PNG of one wheel's target, or None where no scan was fitted."""
    import cv2

    evidence = result.observation.evidence
    if evidence is None or evidence.face is None or evidence.plane is None:
        return None
    face, sigma = evidence.face, evidence.plane.sigma_m
    picture = _coloured(face, sigma)
    _draw_outline(picture, face)
    canvas = np.full((picture.shape[0] + MARGIN, picture.shape[1], 3), 255, np.uint8)
    canvas[MARGIN:] = picture
    title = f"{result.observation.name}  ({result.observation.source})"
    count = f"{evidence.target.points_on_target:,} of {result.observation.points_total:,} points"
    noise = f"rms {evidence.target.plane_rms_m * 1e3:.2f} mm"
    scale = f"blue/red: {FULL_SIGMAS * sigma * 1e3:.2f} mm behind/before the plane"
    for row, text in enumerate((title, f"{count}, {noise}", scale)):
        where = (10, 20 + 20 * row)
        cv2.putText(canvas, text, where, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0, 0, 0), 1, cv2.LINE_AA)
    return bytes(cv2.imencode(".png", canvas)[1])


def _coloured(face: FaceMap, sigma_m: float) -> Image:
    """Residuals from blue (behind) over white to red (before); other surfaces grey."""
    import cv2

    share = np.clip(face.residual_m / max(FULL_SIGMAS * sigma_m, 1e-9), -1.0, 1.0)
    red = np.where(share > 0, 1.0, 1.0 + share)
    blue = np.where(share < 0, 1.0, 1.0 - share)
    green = 1.0 - np.abs(share)
    image = np.stack([blue, green, red], axis=-1) * 255.0
    image[np.isnan(face.residual_m)] = 255.0
    image[face.behind] = 205.0
    large = np.nan_to_num(image).astype(np.uint8)
    return np.asarray(
        cv2.resize(large, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST), np.uint8
    )


def _draw_outline(picture: Image, face: FaceMap) -> None:
    """The disc of the known size about the fitted centre, and a cross at it."""
    import cv2

    middle = picture.shape[0] // 2
    radius = round(face.radius_m / face.half_width_m * middle)
    cv2.circle(picture, (middle, middle), radius, (0, 130, 0), 1, cv2.LINE_AA)
    for dx, dy in ((12, 0), (0, 12)):
        ends = ((middle - dx, middle - dy), (middle + dx, middle + dy))
        cv2.line(picture, *ends, (0, 0, 0), 1, cv2.LINE_AA)
