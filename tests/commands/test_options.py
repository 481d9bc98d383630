"""Options that several commands share: one definition, and former names that still work."""

from __future__ import annotations

import click
import numpy as np
import pytest
from click.testing import CliRunner

from wheelplane.cli import COMMANDS, cli
from wheelplane.commands.shared.five_point_options import read_station
from wheelplane.commands.shared.options import RenamedOption, three_numbers
from wheelplane.errors import ConfigError, InputError

FIVE_POINT = ["--coordinates", "--angle-unit", "--azimuth", "--total-station",
              "--total-station-position"]  # fmt: skip
NEEDED = {"five-point": ["file"], "validate": ["capture"], "batch": ["archive", "-o", "results"]}
RENAMED = [
    ("five-point", "--scanner", "--total-station", "leica-tm30"),
    ("five-point", "--station", "--total-station-position", "1,2,3"),
    ("validate", "--total-station-at", "--total-station-position", "1,2,3"),
    ("validate", "--see", "--detectable", "0.1"),
    ("batch", "--station", "--total-station-position", "1,2,3"),
]


def command_of(name: str) -> click.Command:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    return command


def values(name: str, *options: str) -> dict[str, object]:
    """Values that a command is called with."""
    return command_of(name).make_context(name, [*NEEDED[name], *options]).params


def of(name: str, declaration: str) -> click.Option:
    params = command_of(name).params
    return next(p for p in params if isinstance(p, click.Option) and declaration in p.opts)


@pytest.mark.parametrize(("name", "former", "new", "value"), RENAMED)
def test_a_former_name_means_the_same_as_the_new_one(name, former, new, value):
    given = values(name, new, value)
    assert values(name, former, value) == given
    assert values(name, f"{former}={value}") == given
    assert given != values(name)


def test_every_renamed_option_is_tested():
    found = {
        (name, one.former, one.opts[0])
        for name in COMMANDS
        for one in command_of(name).params
        if isinstance(one, RenamedOption)
    }
    assert found == {row[:3] for row in RENAMED}


@pytest.mark.parametrize(("name", "former", "new", "value"), RENAMED)
@pytest.mark.parametrize("order", [1, -1])
def test_former_and_new_name_together_are_refused(name, former, new, value, order):
    pairs = [(former, value), (new, value)][::order]
    with pytest.raises(click.UsageError, match=f"{former} is the former name of {new}"):
        values(name, *pairs[0], *pairs[1])


@pytest.mark.parametrize(("name", "former", "new", "value"), RENAMED)
def test_help_shows_the_new_name_only(name, former, new, value):
    shown = CliRunner().invoke(cli, [name, "--help"]).stdout.split()
    assert new in shown
    assert former not in shown


@pytest.mark.parametrize("declaration", FIVE_POINT)
def test_five_point_validate_and_batch_define_the_same_option(declaration):
    one, *others = (of(name, declaration) for name in NEEDED)
    for other in others:
        assert (other.name, other.default, other.help) == (one.name, one.default, one.help)
        assert other.type.to_info_dict() == one.type.to_info_dict()


def test_length_units_are_the_same_everywhere():
    for name in (*NEEDED, "measure", "inspect", "plane"):
        assert list(of(name, "--length-unit").type.choices) == ["m", "mm", "in", "cm", "ft"]


def test_the_station_stands_where_it_is_reported_in_metres():
    station = read_station("leica-tm30", "1000,-2000,500", "cartesian", "mm")
    np.testing.assert_array_equal(station.position_m, [1.0, -2.0, 0.5])
    assert station.stated.range_sigma_m > 0.0


def test_spherical_coordinates_have_the_station_at_their_origin():
    np.testing.assert_array_equal(
        read_station("leica-tm30", None, "spherical", "m").position_m, np.zeros(3)
    )
    assert read_station(None, None, "spherical", "m") is None


@pytest.mark.parametrize(
    ("station", "position", "error", "message"),
    [
        (None, "1,2,3", InputError, "--total-station-position without --total-station"),
        ("leica-tm30", None, InputError, "add --total-station-position X,Y,Z"),
        ("leica-tm30", "1,2", InputError, "three numbers"),
        ("default", "1,2,3", ConfigError, "name another scanner"),
    ],
)
def test_a_station_that_is_not_complete_is_refused(station, position, error, message):
    with pytest.raises(error, match=message):
        read_station(station, position, "cartesian", "m")


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,2,inf", "1 2 3"])
def test_what_is_not_three_finite_numbers_is_refused(text):
    with pytest.raises(InputError, match=r"--front .*three numbers"):
        three_numbers("--front", text)
