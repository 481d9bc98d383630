"""Configuration: one frozen model per stage; defaults are here and nowhere else."""

from __future__ import annotations

import datetime
import difflib
import re
import tomllib
from pathlib import Path
from typing import Annotated, TypeVar, get_args

from pydantic import (  # noqa: TID253 - the models need it to exist; nothing else imports it
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
)

from .errors import ConfigError, fact_of, remedy_of

T = TypeVar("T", bound="Section")
# Of a TOML file: more is no settings of anybody, and `tomllib` takes quadratic time and memory.
MAX_TOML_BYTES = 256 << 10
MAX_TOML_TABLES = 2000  # [[...]]
MAX_KEY_PARTS = 32
_TABLES = re.compile(r"^[ \t]*+\[\[", re.MULTILINE)
_PART = r"""(?:(?<![\w-])[\w-]++|"(?:[^"\\\n]++|\\.)*+"|'[^'\n]*+')[ \t]*+"""
_LONG_KEY = re.compile(rf"(?:{_PART}\.[ \t]*+){{{MAX_KEY_PARTS}}}")
TOML_FAULTS = {
    "Invalid value": "a value is a number, true, false, or text in quotes",
    "Cannot overwrite a value": "a key is set twice",
    "Expected newline or end of document after a statement": "more than one value stands on a line"
    " (decimals have a point)",
}
DATE_FORM = "write year, month and day as 2026-11-03, without quotes"
_PLACE = re.compile(r"at line (\d+)")
_NO_DATE = re.compile(r"[ \t]*([\w-]*date)[ \t]*=[ \t]*(\d+[-./]\d+[-./]\d+)[ \t\r]*(?:#|$)")
MOST_FAULTS = 6  # named in one line; the others are counted
# Of a scanner that measures wheels: more is a slip of the unit, such as mm for m.
MOST_ERROR_M, MOST_ARCSEC = 0.1, 3600.0
FORMS = {
    **dict.fromkeys(("model_type", "dict_type"), "a table is needed"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list [...] is needed"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false is needed"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number is needed"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number is needed"),
    "string_type": "text in quotes is needed",
}
DATE_FAULTS = ("date_type", "datetime_type")  # of a date, and of a day or time, which names both
# Sections of who issues a report, which change no result.
ISSUER = frozenset({"report", "laboratory", "standard", "environment"})


class Section(BaseModel):
    """A part of the configuration: unknown keys, wrong types, inf and nan are errors.

    Its validator is built when the first one is made: most commands need a few of all.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, strict=True, defer_build=True
    )


class SegmentConfig(Section):
    """Detection of the target (detection/)."""

    subset_points: int = Field(40_000, ge=1000)
    search_points: int = Field(10_000, ge=500)
    threshold_of_diameter: float = Field(0.016, gt=0.0, lt=0.1)
    around_points: int = Field(400_000, ge=10_000)
    max_proposals: int = Field(1500, ge=100)
    max_planes: int = Field(8, ge=1)
    min_support: float = Field(15.0, gt=3.0)
    min_match: float = Field(0.25, gt=0.0, lt=1.0)
    rival_match: float = Field(0.8, gt=0.0, le=1.0)
    face_match: float = Field(0.45, gt=0.0, le=1.0)


class PlaneConfig(Section):
    """Fit of the plane (plane/)."""

    edge_margin_m: float = Field(0.005, ge=0.0)
    max_iterations: int = Field(50, ge=1)


class CentreConfig(Section):
    """Location of the centre (centre/).

    ambiguity_m: as of an InstrumentConfig; None where it is not known.
    """

    max_points: int = Field(60_000, ge=1000)
    spot_radius_m: float = Field(0.0015, gt=0.0, le=MOST_ERROR_M)
    ambiguity_m: float | None = Field(None, ge=0.0, le=100.0)
    model_uncertainty_m: float = Field(4e-6, ge=0.0)
    max_iterations: int = Field(40, ge=1)


class InstrumentConfig(Section):
    """Scanner: standard uncertainties of type B (uncertainty/type_b.py).

    A scanner's file states them in its table [instrument]. range_sigma_m: noise of one range, with
    which that of the scans is compared. spot_radius_m: overrides that of [centre]. ambiguity_m:
    half the shortest wavelength of a phase-shift scanner's modulation, whose phases add in a mixed
    pixel; 0 of a scanner that averages the ranges in its footprint.
    distance_m: from scanner to target, for scans that do not state the scanner's position.
    range_scale_ppm: error of all ranges, per million. incidence_bias_m: b of the range error b (1 /
    cos(incidence) - 1).
    collimation, trunnion, vertical index, and beam offset: errors of the axes, about the scan's z;
    of an eccentricity the rms amplitude. same_face: all scans were taken in one face of the
    instrument, so that errors of its axes are the same at every station. pointing, registration: of
    a station against the others.
    """

    range_sigma_m: float | None = Field(None, gt=0.0, le=MOST_ERROR_M)
    spot_radius_m: float | None = Field(None, gt=0.0, le=MOST_ERROR_M)
    ambiguity_m: float | None = Field(None, ge=0.0, le=100.0)
    range_bias_m: float = Field(0.0, ge=0.0, le=MOST_ERROR_M)
    range_scale_ppm: float = Field(0.0, ge=0.0, le=10_000.0)
    incidence_bias_m: float = Field(0.0, ge=0.0, le=MOST_ERROR_M)
    collimation_arcsec: float = Field(0.0, ge=0.0, le=MOST_ARCSEC)
    trunnion_arcsec: float = Field(0.0, ge=0.0, le=MOST_ARCSEC)
    vertical_index_arcsec: float = Field(0.0, ge=0.0, le=MOST_ARCSEC)
    azimuth_eccentricity_arcsec: float = Field(0.0, ge=0.0, le=MOST_ARCSEC)
    elevation_eccentricity_arcsec: float = Field(0.0, ge=0.0, le=MOST_ARCSEC)
    beam_offset_m: float = Field(0.0, ge=0.0, le=MOST_ERROR_M)
    same_face: bool = False
    pointing_urad: float = Field(0.0, ge=0.0, le=20_000.0)
    registration_m: float = Field(0.0, ge=0.0, le=MOST_ERROR_M)
    distance_m: float = Field(3.0, gt=0.0, le=200.0)

    def of_stations(self, share: float) -> InstrumentConfig:
        """Return it with that share of the errors that each station has on its own."""
        own = {"pointing_urad": self.pointing_urad, "registration_m": self.registration_m}
        return self.model_copy(update={key: share * value for key, value in own.items()})


class StationConfig(Section):
    """Total station: standard uncertainties of one point (five_point/components.py).

    range: range_sigma_m + range_sigma_ppm * 1e-6 * distance. angle: of azimuth and zenith, on the
    arc. aiming: along each axis of the target's face, for a mark that is sighted by eye.
    """

    range_sigma_m: float = Field(ge=0.0)
    range_sigma_ppm: float = Field(0.0, ge=0.0)
    angle_sigma_arcsec: float = Field(ge=0.0)
    aiming_sigma_m: float = Field(0.0, ge=0.0)
    range_bias_m: float = Field(0.0, ge=0.0)


class ReportConfig(Section):
    """Laboratory that issues the report, and the language (report/format/); changes no result.

    address: lines. logo: path of a picture, relative to the config's folder. signatures: the name
    below each line to be signed.
    """

    laboratory: str = ""
    address: str = ""
    logo: str | None = None
    signatures: tuple[str, ...] = Field((), strict=False)
    language: str = "en"


class LaboratoryConfig(Section):
    """Laboratory that issues certificates; name, address and logo head every report.

    They override those of [report], of which they are the longer form.
    address: lines. place: where it calibrates, if elsewhere. code: of its accreditation. country:
    two letters (ISO 3166-1), for the digital certificate. traceability: sentences of its own.
    """

    name: str = ""
    address: str = ""
    logo: str | None = None
    place: str = ""
    email: str = ""
    phone: str = ""
    code: str = ""
    country: str = Field("", pattern=r"^([A-Z]{2})?$", examples=["PT"])
    traceability: str = ""


class StandardConfig(Section):
    """A reference standard or a sensor. issuer: of its certificate. due: of its recalibration."""

    name: str = Field(min_length=1)
    description: str = ""
    serial: str = ""
    certificate: str = ""
    issuer: str = ""
    calibrated: datetime.date | None = None
    due: datetime.date | None = None


# Where people work: more is a slip of the unit, such as kelvin, kPa or a decimal sign left out.
Celsius = Annotated[float, Field(ge=-40.0, le=60.0)]
Percent = Annotated[float, Field(ge=0.0, le=100.0)]
Hectopascal = Annotated[float, Field(ge=500.0, le=1100.0)]


class EnvironmentConfig(Section):
    """Conditions during a calibration, each the lowest and the highest value.

    With u in its name: expanded uncertainty (95 %), from the sensor's certificate. sensors: names
    of the [[standard]] tables of the sensors.
    """

    temperature_c: tuple[Celsius, Celsius] | None = Field(None, strict=False)
    humidity_percent: tuple[Percent, Percent] | None = Field(None, strict=False)
    pressure_hpa: tuple[Hectopascal, Hectopascal] | None = Field(None, strict=False)
    temperature_u_c: float | None = Field(None, gt=0.0, le=20.0)
    humidity_u_percent: float | None = Field(None, gt=0.0, le=50.0)
    pressure_u_hpa: float | None = Field(None, gt=0.0, le=100.0)
    sensors: tuple[str, ...] = Field((), strict=False)
    note: str = ""


class Config(Section):
    """All sections; `configs/default.toml` shows them with their defaults."""

    segment: SegmentConfig = SegmentConfig()
    plane: PlaneConfig = PlaneConfig()
    centre: CentreConfig = CentreConfig()
    instrument: InstrumentConfig = InstrumentConfig()
    report: ReportConfig = ReportConfig()
    laboratory: LaboratoryConfig = LaboratoryConfig()
    standard: tuple[StandardConfig, ...] = Field((), strict=False)
    environment: EnvironmentConfig = EnvironmentConfig()
    seed: int = Field(0, ge=0)


def config_folder() -> Path:
    """Return the folder of the shipped configuration: in the package, or in the checkout."""
    here = Path(__file__).resolve().parent
    installed = here / "configs"
    return installed if installed.is_dir() else here.parent / "configs"


def config_file(kind: str, name: str) -> Path:
    """Return the path of the `kind` (targets, scanners ...) called `name`, or of that TOML file.

    Raises ConfigError that lists the known names.
    """
    if name.endswith(".toml"):
        path = Path(name)
        if not path.is_file():
            raise ConfigError(f"{name}: no such file: check the path")
        return path
    known = sorted(path.stem for path in (config_folder() / kind).glob("*.toml"))
    if name not in known:
        raise ConfigError(
            f"unknown {kind.removesuffix('s')} {name!r}: {_nearest(name, known)}"
            f"known are {', '.join(known)}; or give a .toml file"
        )
    return config_folder() / kind / f"{name}.toml"


def load_config(path: Path | None) -> Config:
    """Return the effective configuration: the defaults, overridden by the TOML file at `path`."""
    if path is None:
        return Config()
    config = parse_section(Config, read_toml(path), str(path))
    issuer, head = config.laboratory, config.report
    logo = head.logo if issuer.logo is None else issuer.logo
    update = {
        "laboratory": issuer.name or head.laboratory,
        "address": issuer.address or head.address,
        "logo": None if logo is None else str(path.parent / logo),
    }
    return config.model_copy(update={"report": head.model_copy(update=update)})


def with_scanner(config: Config, name: str | None) -> Config:
    """Return the configuration with the laser scanner's file, by name or path, applied.

    What the scanner states of its beam, there or in the configuration, overrides [centre].
    """
    config = _with_beam(config)
    if name is None:
        return config
    stated = _instrument(InstrumentConfig, "laser-scanner", name)
    return _with_beam(config.model_copy(update={"instrument": stated}))


def _with_beam(config: Config) -> Config:
    """Return the configuration with what its [instrument] states of the beam in [centre]."""
    stated = {"spot_radius_m", "ambiguity_m"}
    beam = config.instrument.model_dump(include=stated, exclude_none=True)
    if not beam:
        return config
    return config.model_copy(update={"centre": config.centre.model_copy(update=beam)})


def load_station(name: str) -> StationConfig:
    """Load a total station by name (`leica-tm30`) or TOML file: its table [instrument]."""
    return _instrument(StationConfig, "total-station", name)


def _instrument(model: type[T], kind: str, name: str) -> T:
    table = read_toml(config_file("scanners", name)).get("instrument")
    if not isinstance(table, dict):
        raise ConfigError(f"{name}: it has no table [instrument]: add it, or name another scanner")
    if table.get("kind") != kind:
        raise ConfigError(
            f"{name}: [instrument] kind is {table.get('kind')!r}, {kind!r} is needed here: "
            "name another scanner, or correct its kind"
        )
    stated = {key: value for key, value in table.items() if key != "kind"}
    return parse_section(model, stated, f"{name}: [instrument]")


def read_toml(path: Path) -> dict[str, object]:
    """Parse a TOML file. Raises ConfigError that names the file and the error."""
    try:
        with path.open(encoding="utf-8-sig") as file:  # some editors write a BOM
            text = file.read(MAX_TOML_BYTES + 1)
        _check_extent(text, path)
        table = tomllib.loads(text)
        _check_whole_numbers(table, path)
        return table
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read: {error.strerror}: {remedy_of(error)}"
        ) from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text ({fact_of(error)}): save it as UTF-8") from error
    except RecursionError as error:
        raise ConfigError(f"{path}: not valid TOML: brackets are nested too deep") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: {_fault_of_toml(str(error), text)}") from error
    except ValueError as error:  # of int for 4300 digits
        raise ConfigError(f"{path}: not valid TOML: a number is too long: correct it") from error


def _fault_of_toml(fact: str, text: str) -> str:
    """Return the fault of a TOML text and what to do; of a date that is none, how it is written."""
    place = _PLACE.search(fact)
    line = text.split("\n")[int(place[1]) - 1] if place else ""
    date = _NO_DATE.match(line)
    if place and date:
        return f"{date[1]} = {date[2]} (line {place[1]}): no valid date: {DATE_FORM}"
    for raw, clear in TOML_FAULTS.items():
        fact = fact.replace(raw, clear)
    return f"not valid TOML: {fact}: correct it"


def _check_extent(text: str, path: Path) -> None:
    """Raise ConfigError for a TOML text that would take long to parse."""
    tables = len(_TABLES.findall(text))
    fact = ""
    if len(text) > MAX_TOML_BYTES:
        fact = f"it is longer than {MAX_TOML_BYTES >> 10} kB"
    elif tables > MAX_TOML_TABLES:
        fact = f"it holds {tables} tables [[...]], {MAX_TOML_TABLES} at most"
    elif _LONG_KEY.search(text):
        fact = f"a key has more than {MAX_KEY_PARTS} parts"
    if fact:
        raise ConfigError(f"{path}: {fact}: shorten it")


def _check_whole_numbers(value: object, path: Path) -> None:
    """Raise ConfigError for a whole number of more than TOML's 64 bits."""
    if isinstance(value, dict | list):
        for inner in value.values() if isinstance(value, dict) else value:
            _check_whole_numbers(inner, path)
    elif isinstance(value, int) and not -(2**63) <= value < 2**63:
        raise ConfigError(f"{path}: the whole number {_short(value)} is too large: correct it")


def parse_section(model: type[T], table: dict[str, object], where: str) -> T:
    """Validate `table` as `model`. Raises ConfigError: the first mistakes, with nearest keys."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        found = error.errors()
        faults = "; ".join(dict.fromkeys(_fault(model, fault) for fault in found[:MOST_FAULTS]))
        if len(found) > MOST_FAULTS:
            faults += f"; and {len(found) - MOST_FAULTS} more mistakes"
        raise ConfigError(f"{where}: {faults}") from error


def _fault(model: type[BaseModel], fault: object) -> str:
    assert isinstance(fault, dict)
    path = [str(part) for part in fault["loc"]]
    name = ".".join(path)
    if fault["type"] == "missing":
        return f"{name!r} is missing: add it"
    if fault["type"] == "string_too_short" and not fault["input"]:
        return f"{name} is empty: fill it in"
    if fault["type"] == "value_error":  # of a model's own check: the fact, and what to do
        message = str(fault["msg"]).removeprefix("Value error, ")
        return f"{name}: {message}" if name else message
    if fault["type"] in DATE_FAULTS:
        name = name.removesuffix(".datetime").removesuffix(".date")
        form = "a date is needed, as 2026-11-03, without quotes"
        return f"{name}: {form}, got {_short(fault['input'])}"
    if fault["type"] == "string_pattern_mismatch":
        example = (_section(model, path).model_fields[path[-1]].examples or [""])[0]
        return f"{name}: write it as {example!r}, got {_short(fault['input'])}"
    if fault["type"] != "extra_forbidden":
        raw = str(fault["msg"])
        message = FORMS.get(fault["type"], raw[0].lower() + raw[1:])
        return f"{name.removesuffix('.[key]')}: {message}, got {_short(fault['input'])}"
    known = list(_section(model, path).model_fields)
    return f"unknown key {_short(name)}: {_nearest(path[-1], known)}known are {', '.join(known)}"


def _section(model: type[BaseModel], path: list[str]) -> type[BaseModel]:
    """Return the section of `model` that holds the key at the end of `path`."""
    for part in path[:-1]:
        inner = model.model_fields[part].annotation if part in model.model_fields else None
        for kind in (inner, *get_args(inner)):  # a section, or a tuple of sections
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                model = kind
    return model


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _nearest(name: str, known: list[str]) -> str:
    alike = [other for other in known if other.casefold() == name.casefold()]
    close = alike or difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}? " if close else ""
