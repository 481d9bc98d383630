"""What can be set, and to what: one frozen model a stage; defaults here and nowhere else."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Literal, TypeVar, get_args

from pydantic import (  # noqa: TID253 - the models need it to exist; nothing else imports it
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
)

from pipeline.errors import ConfigError

T = TypeVar("T", bound="Section")
TABLE_FAULTS = ("model_type", "dict_type")


class Section(BaseModel):
    """A part of the configuration: unknown keys, wrong types, inf and nan are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


class SegmentConfig(Section):
    """Finding the target's face (segment.py)."""

    subset_points: int = Field(60_000, ge=1000)
    search_points: int = Field(10_000, ge=500)
    threshold_of_diameter: float = Field(0.016, gt=0.0, lt=0.1)
    around_points: int = Field(400_000, ge=10_000)
    max_proposals: int = Field(1500, ge=100)
    max_planes: int = Field(8, ge=1)
    min_support: float = Field(15.0, gt=3.0)
    min_match: float = Field(0.25, gt=0.0, lt=1.0)
    rival_match: float = Field(0.8, gt=0.0, le=1.0)


class PlaneConfig(Section):
    """Fitting the plane (fit_plane.py)."""

    edge_margin_m: float = Field(0.005, ge=0.0)
    max_iterations: int = Field(50, ge=1)


class CentreConfig(Section):
    """Locating the centre (locate_centre.py)."""

    max_points: int = Field(60_000, ge=1000)
    spot_radius_m: float = Field(0.0015, gt=0.0)
    model_uncertainty_m: float = Field(3e-5, ge=0.0)
    max_iterations: int = Field(40, ge=1)


class Config(Section):
    """All sections; `configs/default.toml` shows them with their defaults."""

    segment: SegmentConfig = SegmentConfig()
    plane: PlaneConfig = PlaneConfig()
    centre: CentreConfig = CentreConfig()
    seed: int = Field(0, ge=0)


class DiscTarget(Section):
    """A flat disc: `diameter` in metres, and its `thickness` where known."""

    shape: Literal["disc"]
    diameter: float = Field(gt=0.01, lt=3.0)
    thickness: float | None = Field(None, ge=0.0, lt=0.2)

    @property
    def radius_m(self) -> float:
        """Half the diameter, metres."""
        return self.diameter / 2.0


def config_folder() -> Path:
    """Folder of the shipped configuration: in an installed package, or beside it in a checkout."""
    here = Path(__file__).parent
    installed = here / "configs"
    return installed if installed.is_dir() else here.parent / "configs"


def config_file(kind: str, name: str) -> Path:
    """Path of the `kind` (targets, scanners, vehicles) called `name`, or of the TOML file `name`.

    Raises ConfigError that lists what is known.
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
    """Effective configuration: the defaults, overridden by the TOML file at `path`."""
    return Config() if path is None else parse_section(Config, read_toml(path), str(path))


def load_target(name: str) -> DiscTarget:
    """Target by name (`disc-250`) or TOML file."""
    path = config_file("targets", name)
    return parse_target(read_toml(path), name)


def parse_target(table: dict[str, object], where: str) -> DiscTarget:
    """Target from a table with `shape` and its sizes in metres; `where` names it in errors."""
    shape = table.get("shape")
    if shape != "disc":
        raise ConfigError(f"{where}: target shape {shape!r} is not known: known is 'disc'")
    return parse_section(DiscTarget, table, where)


def read_toml(path: Path) -> dict[str, object]:
    """Parsed TOML file; ConfigError names the file and what is wrong."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))  # editors write a mark
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}: check the path") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text ({error}): save it as UTF-8") from error
    except RecursionError as error:
        raise ConfigError(f"{path}: not valid TOML: brackets nest too deep") from error
    except ValueError as error:  # of tomllib, and of int for 4300 digits
        raise ConfigError(f"{path}: not valid TOML: {error}") from error


def parse_section(model: type[T], table: dict[str, object], where: str) -> T:
    """`table` as `model`; ConfigError lists every mistake in one line, with the nearest key."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        faults = "; ".join(_fault(model, fault) for fault in error.errors())
        raise ConfigError(f"{where}: {faults}") from error


def _fault(model: type[BaseModel], fault: object) -> str:
    assert isinstance(fault, dict)
    path = [str(part) for part in fault["loc"]]
    name = ".".join(path)
    if fault["type"] == "missing":
        return f"{name!r} is missing: add it"
    if fault["type"] != "extra_forbidden":
        said = "a table is needed" if fault["type"] in TABLE_FAULTS else str(fault["msg"])
        return f"{name}: {said[0].lower()}{said[1:]}, got {_short(fault['input'])}"
    for part in path[:-1]:
        inner = model.model_fields[part].annotation if part in model.model_fields else None
        for kind in (inner, *get_args(inner)):  # a section, or a tuple of sections
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                model = kind
    return f"unknown key {name!r}: {_nearest(path[-1], list(model.model_fields))}known are " + (
        ", ".join(model.model_fields)
    )


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _nearest(name: str, known: list[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}? " if close else ""
