"""Command `wheelplane`; a subcommand is imported when it is called."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
from types import ModuleType

import click

from . import __version__
from .errors import TimeLimitError, WheelplaneError
from .system import hold_freed, signals

COMMANDS = {
    "batch": ("commands.batch:batch", "Measure every capture of an archive; a catalogue."),
    "calibrate": ("commands.calibrate:calibrate", "Calibrate a wheel alignment machine."),
    "demo": ("commands.demo:demo", "Measure a synthetic vehicle with known angles."),
    "five-point": ("commands.five_point:five_point", "Measure five points a wheel."),
    "inspect": ("commands.inspect:inspect", "Summarise a scan file or a capture."),
    "manual": ("commands.manual:manual", "Open the user manual in the browser."),
    "measure": ("commands.measure:measure", "Measure laser scans of the wheels."),
    "plane": ("commands.plane:plane", "Find the planes of a point cloud."),
    "results": ("commands.results:results", "List and summarise the results of a batch."),
    "scanner": ("commands.scanner:scanner", "Derive a scanner's file from field tests."),
    "selftest": ("commands.selftest:selftest", "Fit certified data; a table for the records."),
    "synth": ("commands.synth:synth", "Make a synthetic capture with known angles."),
    "targets": ("commands.targets:targets", "List and draw the known targets."),
    "validate": ("commands.validate:validate", "Compare dense scans with five points."),
    "verify": ("commands.verify:verify", "Check a certificate: its schema, its signature."),
    "view": ("commands.view:view", "Open the web page: load, measure, save reports."),
}


class LazyGroup(click.Group):
    """Group of commands that imports only the one that is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the commands' names in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command; None for a name that is not in the table."""
        if cmd_name not in COMMANDS:
            return None
        module, name = COMMANDS[cmd_name][0].split(":")
        command = getattr(_import(f"{__package__}.{module}"), name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table, so that help imports none of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


HELP = """Toe and camber of a vehicle's wheels from dense laser scans of targets clamped to them.

\b
wheelplane demo DIR              a synthetic vehicle, measured, beside its true angles
wheelplane measure CAPTURE       a folder, zip or tar with one scan a wheel
wheelplane five-point FILE       five surveyed points a wheel
wheelplane validate CAPTURE      the two methods compared
"""


@click.command(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=HELP,
    epilog="Exit codes: 0 measured; 1 measured in part, or not shown to be conforming; "
    "2 unusable input or arguments; 3 an internal error.",
)
@click.version_option(__version__, prog_name="wheelplane")
def cli() -> None:
    """Hold the commands of the table above."""


def _import(name: str) -> ModuleType:
    """Import a module; the garbage collector then passes over what it and the others hold."""
    if name in sys.modules:
        return sys.modules[name]
    gc.disable()
    try:
        return importlib.import_module(name)
    finally:
        gc.freeze()
        gc.enable()


def main() -> None:
    """Run the command; an error is one line: exit code 2 if a user can fix it, else 3."""
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[variable] = "1"  # same bytes with any number of cores
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"  # none is used: do not search for them
    hold_freed()
    for number in signals("SIGTERM", "SIGHUP"):
        if signal.getsignal(number) is signal.SIG_DFL:  # nohup ignores the latter
            signal.signal(number, _end)
    try:
        code = cli.main(prog_name="wheelplane", standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message())
        code = _fail("no command given")
    except WheelplaneError as error:
        code = _fail(str(error))
    except click.UsageError as error:
        hint = f" (see `{error.ctx.command_path} --help`)" if error.ctx else ""
        code = _fail(error.format_message() + hint)
    except click.ClickException as error:
        code = _fail(error.format_message())
    except (click.Abort, KeyboardInterrupt):
        code = _fail("interrupted: nothing more was written")
    except MemoryError:
        code = _fail("out of memory: measure fewer points at once, or on a larger machine")
    except TimeLimitError:  # just as what it limits ended by something else
        code = _fail("it takes too long: allow more by --timeout")
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 2
    except OSError as error:
        code = _fail(
            f"{error.filename or 'input or output'}: {error.strerror}: check path and permissions"
        )
    except EndedError as ended:
        _fail(f"ended by {ended.signal.name}: nothing more was written")
        code = 128 + ended.signal
    except SystemExit:
        raise
    except BaseException:  # a panic of a native library is no Exception
        code = _internal_error()
    sys.exit(code if isinstance(code, int) else 0)


class EndedError(BaseException):
    """A signal that asks the program to end, raised so that temporary files are removed."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.signal = signal.Signals(number)


def _end(number: int, _frame: object) -> None:
    signal.signal(number, signal.SIG_IGN)  # nothing interrupts the removal
    raise EndedError(number)


def _fail(text: str) -> int:
    line = " ".join(text.split())
    click.echo(f"wheelplane: {line}", err=True)
    return 2


def _internal_error() -> int:
    """Write the traceback to a log, and one line that names it; return the exit code 3."""
    import platform
    import tempfile
    import traceback

    text = (
        f"wheelplane {__version__}, Python {platform.python_version()}, {platform.platform()}\n"
        f"{sys.argv}\n\n{traceback.format_exc()}"
    )
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", prefix="wheelplane-error-", suffix=".log", delete=False
        ) as log:
            log.write(text)
        where = f"the log is {log.name}: report the error with this file"
    except OSError as error:
        last = text.strip().splitlines()[-1]
        where = f"no log could be written ({error.strerror}): report this line: {last}"
    _fail(f"internal error of version {__version__}; {where}")
    return 3


if __name__ == "__main__":
    main()
