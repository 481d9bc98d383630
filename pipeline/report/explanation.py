"""Write an explanation to a folder: explanation.json, and two pictures of each scan."""

from __future__ import annotations

from pathlib import Path

from ..explanation import Explanation
from .candidates.pictures import best_drawing, candidates_drawing
from .candidates.tree import explanation_tree
from .format.language import Translations
from .json.text import json_text
from .plots.drawing_png import drawing_png
from .plots.files import file_name
from .write import write_result

PICTURES = ("candidates-*.png", "best-*.png")


def write_explanation(found: Explanation, folder: Path, words: Translations) -> list[Path]:
    """Write the explanation to `folder` and return the files; same capture, same bytes.

    Pictures of an earlier explanation that this one does not replace are removed.
    """
    files: dict[str, bytes] = {}
    pictures: dict[str, list[str]] = {}
    for scan in found.scans:
        drawings = {
            "candidates": candidates_drawing(scan, words),
            "best": best_drawing(scan, words),
        }
        for kind, drawing in drawings.items():
            if drawing is not None:
                name = file_name(f"{kind}-{scan.name}", "png", files)
                files[name] = drawing_png(drawing)
                pictures.setdefault(scan.name, []).append(name)
    tree = explanation_tree(found, pictures, words)
    files["explanation.json"] = f"{json_text(tree)}\n".encode()
    return write_result(folder, files, "explanation.json", PICTURES)
