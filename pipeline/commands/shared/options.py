"""Kinds of option, and how a command is given several."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click

from ...errors import InputError

Command = Callable[..., Any]


class FiniteRange(click.FloatRange):
    """Number in a range, neither infinite nor NaN."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return the number of an argument."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is no finite number.", param, ctx)
        return number


class RenamedOption(click.Option):
    """Option that accepts its former name as well, which help does not show."""

    def __init__(self, *args: Any, former: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.former = former

    def add_to_parser(self, parser: Any, ctx: click.Context) -> None:
        """Register both names; the former one has a destination of its own."""
        super().add_to_parser(parser, ctx)
        parser.add_option(obj=self, opts=[self.former], dest=self.former, action="store")

    def handle_parse_result(
        self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]
    ) -> tuple[Any, list[str]]:
        """Take the value from either name. Raises UsageError where both are given."""
        if self.former in opts:
            if self.name in opts:
                raise click.UsageError(
                    f"{self.former} is the former name of {self.opts[0]}: give {self.opts[0]} only",
                    ctx,
                )
            opts = {**opts, str(self.name): opts[self.former]}
        return super().handle_parse_result(ctx, opts, args)


def option(name: str, *declarations: str, former: str | None = None, **settings: Any) -> Command:
    """Return click's decorator of an option, with the former name of it where it has one."""
    if former is None:
        return click.option(name, *declarations, **settings)
    return click.option(name, *declarations, cls=RenamedOption, former=former, **settings)


def added(options: Sequence[Command], command: Command) -> Command:
    """Add options to a command, in the order in which help shows them."""
    for one in reversed(options):
        command = one(command)
    return command


def three_numbers(option: str, text: str) -> tuple[float, float, float]:
    """Parse X,Y,Z of an option. Raises InputError that names it."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(map(math.isfinite, (x, y, z))):
        raise InputError(f"{option} {text}: three numbers X,Y,Z are needed, such as 100,100,50")
    return x, y, z
