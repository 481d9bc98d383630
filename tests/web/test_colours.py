"""Colours of page, reports and manual, light and dark: text stands out from what it stands on."""

from __future__ import annotations

import re
from importlib import resources

import pytest

GREY_STEPS, ENOUGH = 255.0, 4.5  # WCAG 2.2, 1.4.3: contrast of text
PAIRS = {
    "web/static/page.css": {
        "ink": ("card", "ground", "wash", "hover", "step", "marked"),
        "soft": ("card", "ground", "wash", "step"),
        "link": ("card", "ground", "hover"),
        "good": ("card", "good-wash"),
        "bad": ("card", "bad-wash"),
        "doubt": ("card", "doubt-wash"),
    },
    "report/html/templates/report.css": {
        "ink": ("paper", "wash", "good-wash", "bad-wash", "doubt-wash"),
        "soft": ("paper",),
        "deep": ("paper",),
        "link": ("paper",),
        "good": ("paper", "good-wash"),
        "bad": ("paper", "bad-wash"),
        "doubt": ("paper", "doubt-wash"),
    },
    "manual/pieces/manual.css": {
        "ink": ("paper", "wash"),
        "faint": ("paper", "wash"),
        "accent": ("paper", "wash"),
    },
}


def luminance(colour: str) -> float:
    """Return the relative luminance, as WCAG 2.2 defines it."""
    digits = colour.strip("#")
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    parts = [int(digits[i : i + 2], 16) / GREY_STEPS for i in (0, 2, 4)]
    red, green, blue = (p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(text: str, ground: str) -> float:
    bright, dark = sorted((luminance(text), luminance(ground)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def colours(sheet: str) -> tuple[dict[str, str], dict[str, str]]:
    """Return the colours by name, on light and on dark screens."""
    light, dark = (
        dict(re.findall(r"--([\w-]+): (#\w+);", block))
        for block in re.findall(r":root \{(.*?)\}", sheet, re.DOTALL)[:2]
    )
    return light, dark


def test_contrast_is_that_of_the_standard():
    assert contrast("#000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#fff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("file", PAIRS)
def test_text_can_be_read_on_light_and_on_dark_screens(file):
    sheet = resources.files("wheelplane").joinpath(file).read_text("utf-8")
    light, dark = colours(sheet)
    assert light.keys() >= dark.keys() > set(), "every colour of the dark screen has a light one"
    for one in (light, dark):
        for text, grounds in PAIRS[file].items():
            for ground in grounds:
                assert contrast(one[text], one[ground]) >= ENOUGH, (text, ground, one[text])
    ground = "card" if "card" in light else "paper"
    assert luminance(light[ground]) > 0.8 > 0.05 > luminance(dark[ground])
