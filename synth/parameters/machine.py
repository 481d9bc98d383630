"""Model of the machine file: a wheel alignment machine under test, with known errors."""

from __future__ import annotations

from typing import Literal

from pydantic import Field  # noqa: TID253  a class needs its base at once

from .parameters import Section

INDICATED = ("toe", "camber", "total_toe", "thrust_angle", "track", "caster", "sai",
             "toe_out_on_turns")  # fmt: skip
TrueAxis = Literal["rear-axle", "thrust-line"]


class Identity(Section):
    """Nameplate of the machine."""

    maker: str
    model: str
    serial: str
    software: str


class Protocol(Section):
    """Order of the readings: series of all points, each point `repeats` times a direction."""

    series: int = Field(1, ge=1)
    repeats: int = Field(3, ge=1)
    directions: bool = True
    operators: tuple[str, ...] = Field((), strict=False)


class Indication(Section):
    """Errors of one quantity, in minutes of arc, or millimetres of a length.

    Indicated is sense * truth * (1 + gain) + zero, plus or minus half the hysteresis upwards and
    downwards, plus normal errors of each series (reproducibility) and of each reading
    (repeatability), rounded to the resolution. positive, axis: those that it uses; declared_: those
    that its item file names, where these are wrong.
    """

    positive: str
    axis: TrueAxis | None = None
    declared_positive: str | None = None
    declared_axis: TrueAxis | None = None
    zero: float = 0.0
    gain: float = Field(0.0, gt=-0.5, lt=0.5)
    hysteresis: float = 0.0
    repeatability: float = Field(0.0, ge=0.0)
    reproducibility: float = Field(0.0, ge=0.0)
    resolution: float = Field(gt=0.0)
    mpe: float | None = Field(None, gt=0.0)


class MachineFile(Section):
    """A file of configs/machines/: nameplate, protocol, and a table for each quantity."""

    identity: Identity
    protocol: Protocol = Protocol()
    rule: Literal["guarded", "simple", "shared"] = "guarded"
    toe: Indication | None = None
    camber: Indication | None = None
    total_toe: Indication | None = None
    thrust_angle: Indication | None = None
    track: Indication | None = None
    caster: Indication | None = None
    sai: Indication | None = None
    toe_out_on_turns: Indication | None = None

    def quantities(self) -> dict[str, Indication]:
        """Return the tables of the quantities that it indicates."""
        found = {name: getattr(self, name) for name in INDICATED}
        return {name: table for name, table in found.items() if table is not None}
