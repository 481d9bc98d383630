"""Options of `batch`: how to measure, and where the work is done."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ...config import load_config, with_scanner
from ...errors import InputError
from ...system import check_temporary_folder
from ...targets import read_targets
from .capture_options import (
    capture_options,
    config_option,
    length_unit_option,
    read_options,
    reading_options,
    scanner_option,
    target_option,
    vertical_option,
    whole_vehicle_options,
)
from .five_point_options import five_point_options, radius_option, read_station
from .limits import SECONDS, size_in_bytes
from .options import added

if TYPE_CHECKING:
    from ...batch.plan.settings import BatchSettings
    from ...batch.run.tasks import Engine


OPTIONS = (
    target_option,
    length_unit_option,
    reading_options,
    whole_vehicle_options,
    config_option,
    scanner_option,
    vertical_option,
    five_point_options(former_position="--station"),
    radius_option,
    click.option(
        "--date-in-name",
        metavar="REGEX",
        help="Regular expression for the date in a capture's name: one group round 2026-11-20, or "
        "(?P<y>), (?P<m>), (?P<d>).",
    ),
)
FILES = ("target", "config", "scanner", "total_station")  # or names
WORK_OPTIONS = (
    click.option(
        "--workers",
        type=click.IntRange(min=1),
        help="Number of captures measured at the same time; by default, the number of cores.",
    ),
    click.option(
        "--timeout",
        type=SECONDS,
        default=600.0,
        show_default=True,
        metavar="SECONDS",
        help="Time limit of one capture, after which it is stopped.",
    ),
    click.option(
        "--memory",
        metavar="SIZE",
        help="Memory limit of one capture, such as 4G; by default, a fair share of the machine's.",
    ),
    click.option(
        "--scheduler", metavar="ADDRESS", help="Address of a Dask cluster that does the work."
    ),
)


def measuring_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that `read_settings` reads to a command."""
    return added(OPTIONS, command)


def work_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options that `make_engine` reads to a command."""
    return added(WORK_OPTIONS, command)


def read_settings(options: dict[str, Any]) -> BatchSettings:
    """Return the settings of every measurement. Raises InputError, ConfigError by option."""
    from ...batch.plan.settings import BatchSettings, check_date_pattern

    spherical = options["coordinates"] == "spherical"
    if spherical != (options["angle_unit"] is not None):
        raise InputError("--coordinates spherical and --angle-unit go together: give both")
    if options["date_in_name"]:
        check_date_pattern(options["date_in_name"])
    unit, target, scanner = options["length_unit"], options["target"], options["scanner"]
    station = options["total_station"], options["total_station_position"], options["coordinates"]
    reading = read_options(options["columns"], options["pitch"])
    overrides = capture_options(
        options["front"], options["front_point"], options["up"], unit, reading
    )
    return BatchSettings(
        config=with_scanner(load_config(options["config"]), scanner),
        scanner=scanner,
        target=None if target is None else read_targets(target),
        options=replace(overrides, of_clouds=True),
        vertical=options["vertical"],
        coordinates=options["coordinates"],
        angle_unit=options["angle_unit"],
        azimuth=options["azimuth"],
        station=read_station(*station, unit or "m"),
        radius_m=None if options["radius"] is None else options["radius"] / 1e3,
        date_in_name=options["date_in_name"],
    )


def given_options(options: dict[str, Any]) -> dict[str, str]:
    """Return the measuring options that differ from their defaults, as texts by their names.

    Names of files are absolute, so that the options are of use in any folder.
    """
    given: dict[str, str] = {}
    for parameter in click.command("measuring")(measuring_options(lambda: None)).params:
        name, value = str(parameter.name), options[str(parameter.name)]
        if value is not None and value != parameter.default:
            is_file = name in FILES and Path(value).is_file()
            text = absolute(str(value)) if is_file else str(value)
            given[max(parameter.opts, key=len)] = text
    return given


def make_engine(options: dict[str, Any], scratch: Path) -> Engine:
    """Return what does the work: processes of this machine, or a cluster. Raises InputError."""
    from ...batch.run.cluster import Cluster
    from ...batch.run.workers import Limits, Workers, processors

    limits = Limits(options["timeout"], size_in_bytes(options["memory"]))
    if options["scheduler"] is None:
        check_temporary_folder()
        return Workers(options["workers"] or processors(), limits, scratch)
    if options["workers"] is not None:
        raise InputError(
            "--workers with --scheduler: the cluster has its own workers: leave it out"
        )
    return Cluster(options["scheduler"], limits)


def absolute(path: str) -> str:
    """Return a URL as it is and a local path as an absolute one, the same in every process.

    An empty path, which would be the current folder, remains empty.
    """
    return path if "://" in path or not path else os.path.abspath(path)  # noqa: PTH100 - keeps links
