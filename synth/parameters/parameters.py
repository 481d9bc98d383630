"""Models of the parameter files: one strict model per file, and one per table."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import (  # noqa: TID253  a class needs its base at once
    BaseModel,
    ConfigDict,
    Field,
    model_validator,
)


class Section(BaseModel):
    """One table of a parameter file; units are in the names. unread: tables that are ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
    unread: ClassVar[frozenset[str]] = frozenset()


class Axles(Section):
    """Positions of the four target centres; lengths are between target centres."""

    rear_track_m: float = Field(gt=0.5)
    front_track_m: float = Field(gt=0.5)
    wheelbase_m: float = Field(gt=1.0)
    front_tilt_deg: float = Field(ge=-10.0, le=10.0)
    front_yaw_deg: float = Field(ge=-10.0, le=10.0)
    front_offset_m: float = Field(ge=-0.5, le=0.5)


class Wheels(Section):
    """One wheel: its angles, and the distance of the target face outboard of the sidewall."""

    toe_deg: float = Field(ge=-45.0, le=45.0)
    camber_deg: float = Field(ge=-45.0, le=45.0)
    stand_off_m: float = Field(gt=0.0)
    spin_deg: float


class Trials(Section):
    """Shift of a trial's target centre from its wheel's."""

    shift_forward_m: float
    shift_left_m: float
    shift_up_m: float


class Placement(Section):
    """Pose of the vehicle: roll about forward, pitch about left, then yaw about up."""

    x_m: float
    y_m: float
    z_m: float
    yaw_deg: float
    pitch_deg: float = Field(ge=-45.0, le=45.0)
    roll_deg: float = Field(ge=-45.0, le=45.0)


class Body(Section):
    """Sizes of tyre, rim and wheel arch.

    left_rise_m: how much farther from the floor the left wheel centres are than the right ones.
    """

    tyre_radius_m: float = Field(gt=0.1)
    tyre_width_m: float = Field(gt=0.05)
    rim_diameter_m: float = Field(gt=0.1)
    spokes: int = Field(ge=0, le=60)
    arch_radius_m: float = Field(gt=0.1)
    left_rise_m: float = Field(0.0, ge=-0.05, le=0.05)


class Kingpin(Section):
    """Steering axis of a front wheel: caster, inclination, and scrub radius at the floor."""

    caster_deg: float = Field(4.0, ge=-30.0, le=30.0)
    inclination_deg: float = Field(12.0, ge=-30.0, le=30.0)
    scrub_m: float = Field(0.01, ge=-0.2, le=0.2)


class Sweep(Section):
    """Scans of the front wheels, from lock to lock of the inner wheel; none by default.

    ackermann: share of Ackermann's difference between the outer and the inner wheel.
    """

    positions: int = Field(0, ge=0, le=101)
    rounds: int = Field(1, ge=1, le=20)
    lock_deg: float = Field(20.0, gt=0.0, le=45.0)
    ackermann: float = Field(1.0, ge=0.0, le=2.0)


class Runout(Section):
    """Scans of each wheel rotated about its axle in equal steps; none by default.

    wobble_deg, eccentricity_m: of a target against its axle, each in a drawn direction; their root
    mean square where scatter = "normal": components along two axes are drawn from it.
    turn_sigma_deg: standard deviation of a rotation from that stated in the capture.
    """

    positions: int = Field(0, ge=0, le=36)
    wobble_deg: float = Field(0.5, ge=0.0, le=5.0)
    eccentricity_m: float = Field(0.001, ge=0.0, le=0.02)
    scatter: Literal["fixed", "normal"] = "fixed"
    turn_sigma_deg: float = Field(0.0, ge=0.0, le=20.0)


class BareWheel(Section):
    """Sizes of a wheel, its run-out, and how its surfaces return light.

    flange_height_m: of the rim's flange over the bead seat, whose diameter is the body's
    rim_diameter_m. sidewall_out_m: of the tyre's widest ring outboard of the flange's edge.
    bulge_m: of the sidewall at the contact patch. letters_m: height of the lettering. spokes,
    spoke_width_m: at the rim; dish_m: of the hub inboard of the flange; weights: number of clip-on
    weights. rim_runout_m, tyre_runout_m: total indicator readings of rim and tyre against the spin
    axis, lateral and radial each, of harmonics 1 to 3. tyre_noise: of the range on black rubber,
    times that of the beam; tyre_dropout, rim_stray, rim_multipath: shares of beams.
    """

    flange_height_m: float = Field(0.0173, gt=0.005, lt=0.03)
    sidewall_out_m: float = Field(0.008, ge=0.0, lt=0.03)
    bulge_m: float = Field(0.006, ge=0.0, lt=0.03)
    letters_m: float = Field(0.0007, ge=0.0, lt=0.003)
    spokes: int = Field(10, ge=3, le=24)
    spoke_width_m: float = Field(0.03, gt=0.005, lt=0.08)
    dish_m: float = Field(0.03, ge=0.0, lt=0.1)
    weights: int = Field(1, ge=0, le=4)
    rim_runout_m: float = Field(0.0, ge=0.0, le=0.005)
    tyre_runout_m: float = Field(0.0, ge=0.0, le=0.01)
    tyre_noise: float = Field(3.0, ge=1.0, le=10.0)
    tyre_dropout: float = Field(0.1, ge=0.0, lt=1.0)
    rim_stray: float = Field(0.01, ge=0.0, lt=1.0)
    rim_multipath: float = Field(0.02, ge=0.0, lt=1.0)

    @model_validator(mode="after")
    def _spokes_leave_holes(self) -> BareWheel:
        if self.spokes * self.spoke_width_m > 0.9:
            raise ValueError("the spokes leave no holes; reduce spokes or spoke_width_m")
        return self


class Site(Section):
    """Surroundings of a whole vehicle.

    kind: a workshop bay; or out of doors, with other bare wheels: cars on either side beyond an
    empty place (car-park), a second car behind (two-cars), a third axle behind the rear axle
    (trailer). spare: whether a spare wheel leans against something near the car.
    """

    kind: Literal["bay", "car-park", "two-cars", "trailer"] = "bay"
    spare: bool = False


class VehicleFile(Section):
    """A file of configs/vehicles/."""

    axles: Axles
    wheels: Wheels
    trials: Trials
    placement: Placement
    body: Body
    kingpin: Kingpin = Kingpin()
    sweep: Sweep = Sweep()
    runout: Runout = Runout()
    bare_wheel: BareWheel = BareWheel()
    site: Site = Site()


class Station(Section):
    """Position of the scanner relative to the target; heights are above the floor."""

    distance_m: float = Field(gt=0.5)
    incidence_deg: float = Field(ge=0.0, le=80.0)
    height_min_m: float
    height_max_m: float


class Grid(Section):
    """Beams of one scan: spacing at the target's distance, half-width of the window."""

    spacing_m: float = Field(ge=0.0001)
    half_width_m: float = Field(gt=0.0, le=2.0)


class Beam(Section):
    """Footprint and errors of one beam; the formulas are in footprint.py and scanner.py.

    spot_radius_m: across the beam at the exit, level; of the uniform disc, or where a Gaussian
    beam's power density is 1/e^2 of its axis, which has the same second moment. It grows by
    spot_divergence_mrad (half-angle) along the beam; upwards it is spot_aspect as large.
    spot_truncation: radius at which a Gaussian is cut, in units of the 1/e^2 radius.
    power_weighted: each part of the spot counts with the power that it returns, albedo times
    cosine; otherwise all parts that return anything count alike, and half a spot must.
    brightness_bias_m: range error of a surface of albedo 0.1 against one of 0.8, linear in albedo;
    incidence_bias_m, b: range error b (1 / cos - 1) at the incidence.
    noise_by_brightness, k: the range noise of a surface is (0.8 / albedo)^k times that of a light
    one; 0.5 where the noise of the light rules, 1 where that of the receiver does.
    return_mode: which return of a spot that meets several surfaces is reported: the average of
    all, or the first, last or strongest (by its intensity) of those that are range_gate_m or more
    apart; or two, the first and the last, each as a point (a multi-echo scanner; scans of single
    wheels only).
    ambiguity_m: of a phase-shift scanner, half the shortest wavelength of its modulation, whose
    phases add as vectors; 0: an average is the mean of the ranges.
    detector_threshold: least power detected, albedo * cosine / range^2 of a whole spot, as the
    intensity.
    edge_filter_m: as software that filters edge points, leave out those whose range differs by more
    from that of one of the eight beams beside them; 0: none (scans of single wheels only).
    line_sigma_m: standard deviation of a range error that is common to a scan line; lines are
    columns (the mirror turns about a level axis) or rows of the grid. correlation_aspect: the
    correlation length along azimuth over that along elevation, which is correlation_length_m.

    correlated_sigma_m: of the part of the range noise that is correlated over
    correlation_length_m, L: exp(-d^2 / (2 L^2)) at the distance d across the beams at the target.
    """

    range_sigma_m: float = Field(ge=0.0)
    angle_sigma_urad: float = Field(ge=0.0)
    spot_radius_m: float = Field(ge=0.0, le=0.02)
    dropout_fraction: float = Field(ge=0.0, lt=1.0)
    stray_fraction: float = Field(ge=0.0, lt=1.0)
    intensity_sigma: float = Field(ge=0.0)
    correlated_sigma_m: float = Field(0.0, ge=0.0)
    correlation_length_m: float = Field(0.0, ge=0.0, le=1.0)
    spot_profile: Literal["uniform", "gaussian"] = "uniform"
    spot_divergence_mrad: float = Field(0.0, ge=0.0, le=5.0)
    spot_aspect: float = Field(1.0, ge=0.1, le=10.0)
    spot_truncation: float = Field(2.0, ge=0.5, le=3.0)
    power_weighted: bool = False
    brightness_bias_m: float = Field(0.0, ge=-0.1, le=0.1)
    incidence_bias_m: float = Field(0.0, ge=-0.1, le=0.1)
    noise_by_brightness: float = Field(0.0, ge=0.0, le=2.0)
    return_mode: Literal["average", "first", "last", "strongest", "two"] = "average"
    range_gate_m: float = Field(0.0, ge=0.0, le=10.0)
    ambiguity_m: float = Field(0.0, ge=0.0, le=100.0)
    detector_threshold: float = Field(0.0, ge=0.0)
    edge_filter_m: float = Field(0.0, ge=0.0, le=1.0)
    line_sigma_m: float = Field(0.0, ge=0.0, le=0.1)
    scan_lines: Literal["columns", "rows"] = "columns"
    correlation_aspect: float = Field(1.0, ge=0.01, le=100.0)

    @property
    def is_thin(self) -> bool:
        """Whether the beam has no footprint."""
        return self.spot_radius_m == 0.0 and self.spot_divergence_mrad == 0.0

    @model_validator(mode="after")
    def _has_a_length(self) -> Beam:
        if self.correlated_sigma_m > 0.0 and self.correlation_length_m == 0.0:
            raise ValueError("correlated_sigma_m needs a correlation_length_m above 0")
        return self

    @model_validator(mode="after")
    def _parts_returns(self) -> Beam:
        if self.return_mode != "average" and not (self.power_weighted and self.range_gate_m > 0.0):
            raise ValueError(
                f"return_mode '{self.return_mode}' needs a range_gate_m above 0 and power_weighted"
            )
        return self


class Sensor(Section):
    """Kind of the instrument that scans a wheel; the geometry is in sensors.py.

    baseline_m: from the camera to the projector of structured light, from the laser to the camera
    of a profile sensor, in the direction turn_deg of the image, anticlockwise from level.
    """

    kind: Literal["laser-scanner", "structured-light", "line-profile"] = "laser-scanner"
    baseline_m: float = Field(0.3, ge=0.0, le=5.0)
    turn_deg: float = 0.0


class Calibration(Section):
    """Systematic errors of the instrument, the same in all scans; formulas in systematic.py.

    range_scale_ppm: per million of the range. eccentricity: amplitude of an encoder's first
    harmonic, and the angle at which it is zero and rises. beam_offset_m: of the beam from the
    vertical axis, to the side. face: 2 reverses all angular terms but the elevation's eccentricity
    in cos e, which alone is in the mean of both faces.
    """

    range_offset_m: float = Field(0.0, ge=-0.1, le=0.1)
    range_scale_ppm: float = Field(0.0, ge=-1000.0, le=1000.0)
    collimation_arcsec: float = Field(0.0, ge=-3600.0, le=3600.0)
    trunnion_arcsec: float = Field(0.0, ge=-3600.0, le=3600.0)
    vertical_index_arcsec: float = Field(0.0, ge=-3600.0, le=3600.0)
    azimuth_eccentricity_arcsec: float = Field(0.0, ge=-3600.0, le=3600.0)
    azimuth_eccentricity_at_deg: float = 0.0
    elevation_eccentricity_arcsec: float = Field(0.0, ge=-3600.0, le=3600.0)
    elevation_eccentricity_at_deg: float = 0.0
    beam_offset_m: float = Field(0.0, ge=-0.01, le=0.01)
    face: int = Field(1, ge=1, le=2)


class Registration(Section):
    """Standard deviations, along and about each axis, of the pose of each station from its own."""

    shift_sigma_m: float = Field(0.0, ge=0.0, le=0.1)
    turn_sigma_arcsec: float = Field(0.0, ge=0.0, le=3600.0)


class Surfaces(Section):
    """Albedos of surfaces (Lambert's reflectance); those left out keep the generator's own.

    face, wall: of the target, its measured face and its other sides. dark_part: of every face, of
    albedo `dark`: the half at dark_turn_deg from the axis u towards v, or the squares of a
    checkerboard of dark_pitch_m so rotated, one corner at the centre.
    """

    face: float | None = Field(None, ge=0.0, le=1.0)
    wall: float | None = Field(None, ge=0.0, le=1.0)
    rim: float | None = Field(None, ge=0.0, le=1.0)
    tyre: float | None = Field(None, ge=0.0, le=1.0)
    floor: float | None = Field(None, ge=0.0, le=1.0)
    dark_part: Literal["none", "half", "squares"] = "none"
    dark: float = Field(0.1, ge=0.0, le=1.0)
    dark_turn_deg: float = 0.0
    dark_pitch_m: float = Field(0.05, gt=0.0, le=1.0)


class Obstacle(Section):
    """Obstacle between scanner and target: the fraction of the target's face that it hides."""

    occluded_fraction: float = Field(0.0, ge=0.0, le=0.9)


class Panorama(Section):
    """Scans of a whole vehicle: their points together, and the window of each station.

    stations: outside the corners at RR, RL, FR, FL, then at the left and the right side.
    window_deg: of azimuth, about the middle of the vehicle.
    """

    points: int = Field(20_000_000, ge=10_000, le=1_000_000_000)
    stations: int = Field(4, ge=4, le=6)
    window_deg: float = Field(360.0, ge=60.0, le=360.0)
    lowest_deg: float = Field(-60.0, ge=-75.0, le=-20.0)
    highest_deg: float = Field(40.0, ge=0.0, le=75.0)


class Corner(Section):
    """Position of such a station: along and across the vehicle from its corner's target, and up."""

    ahead_m: float = Field(1.0, ge=0.3, le=1.8)
    aside_m: float = Field(2.1, ge=1.5, le=2.9)
    height_m: float = Field(1.4, ge=0.5, le=2.0)


class TotalStation(Section):
    """The instrument that measures five points per target."""

    distance_m: float = Field(gt=0.0)
    height_m: float
    pentagon_radius_m: float = Field(gt=0.0)
    aiming_sigma_m: float = Field(ge=0.0)
    range_sigma_m: float = Field(ge=0.0)
    range_sigma_ppm: float = Field(ge=0.0)
    angle_sigma_arcsec: float = Field(ge=0.0)


class ScannerFile(Section):
    """A file of configs/scanners/; its table [instrument] is for the measurement."""

    station: Station
    grid: Grid
    beam: Beam
    total_station: TotalStation
    scene: Obstacle = Obstacle()
    surfaces: Surfaces = Surfaces()
    sensor: Sensor = Sensor()
    calibration: Calibration = Calibration()
    registration: Registration = Registration()
    panorama: Panorama = Panorama()
    corner: Corner = Corner()
    unread: ClassVar[frozenset[str]] = frozenset({"instrument"})

    @model_validator(mode="after")
    def _suits_its_kind(self) -> ScannerFile:
        kind = self.sensor.kind
        if kind != "laser-scanner" and not self.beam.is_thin:
            raise ValueError(f"sensor.kind '{kind}': it has no spot; set beam.spot_radius_m to 0")
        if kind != "laser-scanner" and self.calibration != Calibration():
            raise ValueError(f"sensor.kind '{kind}': [calibration] is of laser scanners; remove it")
        return self
