"""What the parameter files may say: one strict model a file, one a table."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field  # noqa: TID253  a class needs its base at once


class Section(BaseModel):
    """One table of a parameter file; units are in the names."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class Axles(Section):
    """Where the four target centres lie; lengths are between target centres."""

    rear_track_m: float = Field(gt=0.5)
    front_track_m: float = Field(gt=0.5)
    wheelbase_m: float = Field(gt=1.0)
    front_tilt_deg: float = Field(ge=-10.0, le=10.0)
    front_yaw_deg: float = Field(ge=-10.0, le=10.0)
    front_offset_m: float = Field(ge=-0.5, le=0.5)


class Wheels(Section):
    """One wheel: its angles, and how far the target face stands outboard of the sidewall."""

    toe_deg: float = Field(ge=-45.0, le=45.0)
    camber_deg: float = Field(ge=-45.0, le=45.0)
    stand_off_m: float = Field(gt=0.0)
    spin_deg: float


class Trials(Section):
    """How a trial's target centre is shifted from its wheel's."""

    shift_forward_m: float
    shift_left_m: float
    shift_up_m: float


class Placement(Section):
    """Pose in the capture: turned by roll about forward, pitch about left, then yaw about up."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float
    pitch_deg: float = Field(ge=-45.0, le=45.0)
    roll_deg: float = Field(ge=-45.0, le=45.0)


class Body(Section):
    """Sizes of tyre, rim and wheel arch."""

    tyre_radius_m: float = Field(gt=0.1)
    tyre_width_m: float = Field(gt=0.05)
    rim_diameter_m: float = Field(gt=0.1)
    spokes: int = Field(ge=0, le=60)
    arch_radius_m: float = Field(gt=0.1)


class VehicleFile(Section):
    """A file of configs/vehicles/."""

    axles: Axles
    wheels: Wheels
    trials: Trials
    placement: Placement
    body: Body


class Station(Section):
    """Where the scanner stands, seen from the target; heights are above the floor."""

    distance_m: float = Field(gt=0.5)
    incidence_deg: float = Field(ge=0.0, le=80.0)
    height_min_m: float
    height_max_m: float


class Grid(Section):
    """Beams of one scan: spacing at the target's distance, half-width of the window."""

    spacing_m: float = Field(ge=0.0001)
    half_width_m: float = Field(gt=0.0, le=2.0)


class Beam(Section):
    """Errors of one beam; the formulas are in scanner.py."""

    range_sigma_m: float = Field(ge=0.0)
    angle_sigma_urad: float = Field(ge=0.0)
    spot_radius_m: float = Field(ge=0.0, le=0.02)
    dropout_fraction: float = Field(ge=0.0, lt=1.0)
    stray_fraction: float = Field(ge=0.0, lt=1.0)
    intensity_sigma: float = Field(ge=0.0)


class TotalStation(Section):
    """The instrument that measures five points a target."""

    distance_m: float = Field(gt=0.0)
    height_m: float
    pentagon_radius_m: float = Field(gt=0.0)
    aiming_sigma_m: float = Field(ge=0.0)
    range_sigma_m: float = Field(ge=0.0)
    range_sigma_ppm: float = Field(ge=0.0)
    angle_sigma_arcsec: float = Field(ge=0.0)


class ScannerFile(Section):
    """A file of configs/scanners/."""

    station: Station
    grid: Grid
    beam: Beam
    total_station: TotalStation


class TargetFile(Section):
    """A file of configs/targets/, lengths in metres; the generator knows discs."""

    shape: Literal["disc"]
    diameter: float = Field(gt=0.0)
    thickness: float = Field(gt=0.0)
