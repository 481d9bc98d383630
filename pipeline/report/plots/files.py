"""All plots of a measurement as files: each as SVG and as PNG, and one as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...measurement import Conformity, Measurement
from ..format.language import Translations
from ..format.view import View
from ..scene.scene import scene
from .angle_chart import angles_text
from .angles import angles_drawing
from .budget import budget_drawing
from .drawing import Drawing
from .drawing_png import drawing_png
from .frame import frame_drawing
from .residuals import histogram_drawing, profile_drawing
from .target_face import face_drawing
from .top_view import top_drawing

ANGLES = "angles.txt"  # which every measurement has
OF_SCANS = ("residuals-*.svg", "residuals-*.png", "histogram-*.svg", "histogram-*.png",
            "profile-*.svg", "profile-*.png")  # fmt: skip


def plot_files(
    measurement: Measurement, conformity: Conformity | None, words: Translations, view: View
) -> dict[str, bytes]:
    """Return name and content of each file; same measurement, same bytes."""
    files = {ANGLES: angles_text(measurement, conformity, words, view).encode()}
    for stem, drawing in _drawings(measurement, conformity, words, view):
        name = file_name(stem, "svg", files)
        files[name] = drawing.svg.encode()
        files[name.removesuffix("svg") + "png"] = drawing_png(drawing)
    return files


def _drawings(
    measurement: Measurement, conformity: Conformity | None, words: Translations, view: View
) -> Iterator[tuple[str, Drawing]]:
    yield "angles", angles_drawing(measurement, conformity, words, view.axis)
    yield "top", top_drawing(measurement, words, view)
    yield "frame", frame_drawing(scene(measurement, conformity, words, view), words)
    yield "budget", budget_drawing(measurement, words, view.axis)
    for result in measurement.wheels:
        name = result.observation.name
        face = face_drawing(result, measurement.frame, words)
        histogram = histogram_drawing(result, words)
        if face is not None and histogram is not None:
            yield f"residuals-{name}", face
            yield f"histogram-{name}", histogram
        profile = profile_drawing(result, words)
        if profile is not None:
            yield f"profile-{name}", profile


def file_name(stem: str, suffix: str, taken: Iterable[str]) -> str:
    """Return a portable file name that differs from all in `taken`."""
    plain = "".join(c if c.isalnum() or c in "-_" else "_" for c in stem)[:47]
    while f"{plain}.{suffix}".casefold() in (other.casefold() for other in taken):
        plain += "_"
    return f"{plain}.{suffix}"
