"""The vehicle's frame, wheels and cloud in one still picture, of the same scene as the 3D view."""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np

from ...vectors import Array
from ..format.language import Translations
from .drawing import Anchor, Dots, Drawing, Mark, Path, Text, arrow

WIDTH, HEIGHT, MARGIN = 760.0, 430.0, 42.0
MOST_DOTS = 4_000
AZIMUTH, ELEVATION = math.radians(38.0), math.radians(27.0)  # viewpoint: front left, above
COLOURS = {"reference": "#0072B2", "trial": "#CC79A7", "bad": "#D55E00"}
LINES = {"frame": "#444444", "axes": "#009E73", "kingpin": "#8a5a00"}
AXIS_NAME, BESIDE = "#00694d", 8.0  # colour, and distance from the arrow
NORMAL_M = 0.3


def frame_drawing(scene: dict[str, Any], words: Translations) -> Drawing:
    """Draw the scene by parallel projection."""
    project = _fitted(scene)
    cloud = _points(scene["cloud"])
    marks: list[Mark] = [Dots(project(cloud), 1.1, "#9a9a9a")] if len(cloud) else []
    axes: list[Mark] = []
    for line in scene["lines"]:
        start, end = project(np.array([line["from"], line["to"]]))
        colour = LINES[line["layer"]]
        if line["layer"] == "axes":
            axes += [*arrow(start, end, colour, 2.0), _axis_name(line["name"], start, end)]
        else:
            dash = (7.0, 4.0) if line["layer"] == "frame" else None
            marks.append(Path([start, end], colour, 1.4, dash=dash))
    for wheel in scene["wheels"]:
        marks += _wheel(wheel, project)
    title = words("plot.frame_title")
    return Drawing(WIDTH, HEIGHT, title, [*marks, *axes])


def _axis_name(name: str, start: Array, end: Array) -> Text:
    """Return the name of an axis above its arrow, clear of the lines along it."""
    along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    above = np.array([along[1], -along[0]]) * (1.0 if along[0] >= 0.0 else -1.0)
    x, y = start + 0.6 * (end - start) + BESIDE * above
    anchor: Anchor = "start" if above[0] > 0.0 else "end"
    return Text(x, y, name, 12, anchor, colour=AXIS_NAME, halo=3.0)


def _wheel(wheel: dict[str, Any], project: Any) -> list[Mark]:
    """Draw a target, its normal, and the name of a reference wheel."""
    colour = COLOURS[wheel["colour_class"]]
    outer, *holes = (project(np.array(edge)) for edge in wheel["outline"])
    reference = wheel["role"] == "reference"
    marks: list[Mark] = [Path(outer, colour, 1.8, closed=True)]
    if reference:
        marks.insert(0, Path(outer, fill=colour, closed=True, opacity=0.25))
    marks += [Path(hole, colour, 1.0, closed=True) for hole in holes]
    centre = np.array(wheel["centre"])
    start, end = project(np.array([centre, centre + NORMAL_M * np.array(wheel["normal"])]))
    if reference:
        marks += arrow(start, end, colour, 1.6)
        away = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        x, y = end + 14 * away + (0, 5)
        marks.append(Text(x, y, wheel["label"], 15, "middle", bold=True, colour=colour))
    return marks


def _fitted(scene: dict[str, Any]) -> Any:
    """Return a projection (N, 3) to (N, 2) in which all wheels and lines fit."""
    right = np.array([-math.sin(AZIMUTH), math.cos(AZIMUTH), 0.0])
    back = np.array([math.cos(AZIMUTH), math.sin(AZIMUTH), 0.0])
    sine, cosine = math.sin(ELEVATION), math.cos(ELEVATION)
    down = np.array([0.0, 0.0, -cosine]) + sine * back
    M = np.array([right, down]).T
    ends = [line[end] for line in scene["lines"] for end in ("from", "to")]
    edges = [point for wheel in scene["wheels"] for edge in wheel["outline"] for point in edge]
    tips = [np.add(w["centre"], NORMAL_M * np.array(w["normal"])) for w in scene["wheels"]]
    flat = np.array([*ends, *edges, *tips], float) @ M
    low, high = flat.min(axis=0), flat.max(axis=0)
    room = np.array([WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN])
    scale = float(np.min(room / np.maximum(high - low, 1e-6)))
    shift = np.array([WIDTH, HEIGHT]) / 2.0 - scale * (low + high) / 2.0
    return lambda points: np.asarray(points) @ M * scale + shift


def _points(cloud: dict[str, Any] | None) -> Array:
    """Return about MOST_DOTS points (N, 3) of the scene's cloud."""
    if cloud is None:
        return np.zeros((0, 3))
    grid = np.frombuffer(base64.b64decode(cloud["positions"]), "<i2").reshape(-1, 3)
    step = max(1, math.ceil(len(grid) / MOST_DOTS))
    return np.asarray(grid[::step] * cloud["step_m"] + np.array(cloud["origin"]))
