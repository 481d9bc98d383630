"""The vehicle as a workshop reads it: axle by axle, then what joins the axles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ...measurement import Measurement, Stated, against, by_name, stated
from ...vehicle import AXES, named
from ..format.layout import aligned
from ..format.view import DEFINED, PAPER, View

Row = tuple[str, ...]
Known = Mapping[tuple[str, str], Stated]  # by subject and kind
AXLES = (("front", "FL", "FR"), ("rear", "RL", "RR"))
ANGLES = (
    ("thrust_angle", "thrust angle, + to the right"),
    ("steer_ahead", "steer ahead, + to the right"),
    ("rear_squareness", "rear squareness, + right wheel behind"),
)
LENGTHS = ("rear_track", "front_track", "wheelbase", "wheelbase_left", "wheelbase_right")
BY_DEFINITION = "none by this axis"
SIGNS = "Toe-in and top-out are positive on both sides. total: left + right; cross: left - right."
READING = """\
Thrust angle: of the line that bisects the rear toes, against the axis named. Steer ahead: half of
what front left toe exceeds front right toe, against the thrust line. Rear squareness: of the rear
axle against the geometric centreline. Wheelbase: from the rear axle's middle to the front axle,
along the rear axle's normal; left and right: from centre to centre of a side. Setback: along the
axis named. Front axle offset: of its middle from that axis through the rear axle's middle."""


def vehicle_lines(measurement: Measurement, view: View = PAPER) -> str:
    """The axis in use, a block an axle, then angles and lengths of the whole, each with its u."""
    chosen = against(stated(measurement), view.axis)
    known = {(quantity.subject, quantity.kind): quantity for quantity in chosen}
    axles = [row for axle in AXLES for row in _axle(known, view, *axle)]
    rows = [*_angles(measurement, known, view), *_lengths(known)]
    return "\n".join(
        [
            f"Longitudinal axis in use ({view.axis}): the {DEFINED[view.axis]}.",
            SIGNS,
            aligned([("", "", "left", "right", "", "", "u"), *axles], left=2),
            "",
            aligned([("", "", "u"), *rows], left=1),
        ]
    )


def axes_text(measurement: Measurement, view: View) -> str:
    """The four axes: angle to the paper's, and what each makes of the toe of the four wheels."""
    known = by_name(measurement)
    angle_of = dict(
        zip(AXES[1:], ("centreline_angle", "thrust_angle", "side_bisector_angle"), strict=True)
    )
    wheels = ("FL", "FR", "RL", "RR")
    rows: list[Row] = [("", "+ to the right", "u", *(f"toe {wheel}" for wheel in wheels))]
    for axis in AXES:
        turned = known.get(angle_of.get(axis, ""))
        angle = view.angle(turned.value if turned else 0.0, "heading")
        u = view.width(turned.u, "heading", turned.value) if turned else "-"
        toes = (known[f"{wheel}.{named('toe', axis)}"].value for wheel in wheels)
        rows.append((axis, angle, u, *(view.angle(toe, "toe") for toe in toes)))
    return (
        "Longitudinal axes: angle to the normal of the rear axle, and toe against each\n"
        + aligned(rows, left=1)
    )


def setback_words(setback_m: float) -> str:
    """Which wheel of an axle stands behind, in words, since manuals differ in the sign."""
    behind, ahead = ("right", "left") if setback_m > 0.0 else ("left", "right")
    return f"{behind} wheel {abs(setback_m) * 1e3:.3f} mm behind {ahead}"


def offset_words(offset_m: float) -> str:
    """To which side of the longitudinal axis the front axle stands."""
    return f"{abs(offset_m) * 1e3:.3f} mm to the {'right' if offset_m > 0.0 else 'left'}"


def difference_words(difference_m: float) -> str:
    """Which side has the longer wheelbase."""
    return f"{'left' if difference_m > 0.0 else 'right'} longer by {abs(difference_m) * 1e3:.3f} mm"


WORDS = (
    ("wheelbase_difference", "wheelbase difference", difference_words),
    ("front_setback", "front setback", setback_words),
    ("rear_setback", "rear setback", setback_words),
    ("axle_offset", "front axle offset", offset_words),
)


def _axle(known: Known, view: View, axle: str, left: str, right: str) -> Iterator[Row]:
    """Toe with its total, and camber with its cross value."""
    toes = [known[wheel, "toe"].value for wheel in (left, right)]
    total = known["vehicle", f"{axle}_total_toe"]
    u = view.width(total.u, "toe", total.value / 2.0)
    texts = (view.angle(toe, "toe") for toe in toes)
    yield (axle, "toe", *texts, "total", view.total_toe(*toes), u)
    cross = known["vehicle", f"{axle}_cross_camber"]
    texts = (view.angle(known[wheel, "camber"].value, "camber") for wheel in (left, right))
    told = view.angle(cross.value, "camber")
    yield ("", "camber", *texts, "cross", told, view.width(cross.u, "camber"))


def _angles(measurement: Measurement, known: Known, view: View) -> Iterator[Row]:
    for kind, label in ANGLES:
        what = known.get(("vehicle", kind))
        if what is None:
            yield label, BY_DEFINITION, "-"
        else:
            u = view.width(what.u, "heading", what.value)
            yield label, view.angle(what.value, "heading"), u
    if view.axis == "thrust-line":  # as the front axle's block has them
        return
    for wheel, side in (("FL", "left"), ("FR", "right")):
        toe = by_name(measurement)[f"{wheel}.{named('toe', 'thrust-line')}"]
        label = f"front {side} toe to the thrust line"
        yield label, view.angle(toe.value, "toe"), view.width(toe.u, "toe", toe.value)


def _lengths(known: Known) -> Iterator[Row]:
    for kind in LENGTHS:
        what = known["vehicle", kind]
        yield kind.replace("_", " "), f"{what.value:.5f} m", f"{what.u * 1e3:.3f} mm"
    for kind, label, words in WORDS:
        found = known.get(("vehicle", kind))
        if found is None:
            yield label, BY_DEFINITION, "-"
        else:
            yield label, words(found.value), f"{found.u * 1e3:.3f} mm"
