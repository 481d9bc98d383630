"""The options of `batch` that say how to measure and with what, and what they mean."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from ..config import load_config, with_scanner
from ..errors import InputError
from ..targets import load_target
from ..units import LENGTH_UNITS, AngleUnit, Azimuth, Coordinates
from .options import read_station, told, whole_vehicle_options

if TYPE_CHECKING:
    from ..batch.plan.settings import Settings
    from ..batch.run.tasks import Engine

MEMORY = re.compile(r"(\d+(?:\.\d+)?)([KMGT])(?:i?B)?", re.IGNORECASE)

OPTIONS = (
    click.option("--target", metavar="NAME|FILE", help="Of captures of scans; see `targets`."),
    click.option("--length-unit", type=click.Choice(LENGTH_UNITS), help="Of all coordinates."),
    whole_vehicle_options,
    click.option(
        "--config", type=click.Path(path_type=Path), metavar="FILE", help="Settings (TOML)."
    ),
    click.option("--scanner", metavar="NAME|FILE", help="Of captures of scans."),
    click.option(
        "--coordinates",
        type=click.Choice(get_args(Coordinates)),
        default="cartesian",
        show_default=True,
        help="Of five-point files, as the next four.",
    ),
    click.option("--angle-unit", type=click.Choice(get_args(AngleUnit)), help="Of spherical ones."),
    click.option(
        "--azimuth", type=click.Choice(get_args(Azimuth)), default="auto", show_default=True
    ),
    click.option("--total-station", metavar="NAME|FILE", help="Which, such as leica-tm30."),
    click.option("--station", metavar="X,Y,Z", help="Where it stood."),
    click.option(
        "--date-in-name",
        metavar="REGEX",
        help="Takes a capture's day from its name: one group round 2026-11-20, or (?P<y>), m, d.",
    ),
)
WORK_OPTIONS = (
    click.option("--workers", type=click.IntRange(min=1), help="At the same time; else all cores."),
    click.option(
        "--timeout",
        type=click.FloatRange(min=1),
        default=600.0,
        show_default=True,
        metavar="SECONDS",
        help="A capture that takes longer is stopped.",
    ),
    click.option(
        "--memory", metavar="SIZE", help="That a capture may take, such as 4G; else a fair share."
    ),
    click.option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster that does the work."),
)


def measuring_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that `read_settings` reads to a command."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


def work_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that `make_engine` reads to a command."""
    for option in reversed(WORK_OPTIONS):
        command = option(command)
    return command


def read_settings(options: dict[str, Any]) -> Settings:
    """How to measure. Raises InputError or ConfigError that names the option."""
    from ..batch.plan.settings import Settings, check_date_pattern

    spherical = options["coordinates"] == "spherical"
    if spherical != (options["angle_unit"] is not None):
        raise InputError("--coordinates spherical and --angle-unit go together: give both")
    if options["date_in_name"]:
        check_date_pattern(options["date_in_name"])
    unit, target, scanner = options["length_unit"], options["target"], options["scanner"]
    surveyed = options["total_station"], options["station"], options["coordinates"]
    front = told(options["front"], options["front_point"], options["up"], unit)
    return Settings(
        config=with_scanner(load_config(options["config"]), scanner),
        scanner=scanner,
        target=None if target is None else load_target(target),
        told=replace(front, of_clouds=True),
        coordinates=options["coordinates"],
        angle_unit=options["angle_unit"],
        azimuth=options["azimuth"],
        station=read_station("--total-station", *surveyed, unit or "m"),
        date_in_name=options["date_in_name"],
    )


def make_engine(options: dict[str, Any], scratch: Path) -> Engine:
    """Who does the work. Raises InputError that names the option."""
    from ..batch.run.cluster import Cluster
    from ..batch.run.workers import Limits, Workers, processors

    limits = Limits(options["timeout"], _bytes(options["memory"]))
    if options["scheduler"] is None:
        return Workers(options["workers"] or processors(), limits, scratch)
    if options["workers"] is not None:
        raise InputError("--workers with --scheduler: the cluster has its own: leave it out")
    return Cluster(options["scheduler"], limits)


def absolute(place: str) -> str:
    """A URL as it is, a local path from the root, so that it is the same for every process."""
    return place if "://" in place else os.path.abspath(place)  # noqa: PTH100 - keeps links


def _bytes(size: str | None) -> int | None:
    if size is None:
        return None
    found = MEMORY.fullmatch(size)
    if found is None:
        raise InputError(f"--memory {size}: a size such as 900M or 4G is needed")
    return int(float(found[1]) * 2 ** (10 * (1 + "KMGT".index(found[2].upper()))))
